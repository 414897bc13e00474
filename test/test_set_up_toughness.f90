!> The toughness of lattices: the table against solves, what solves must not depend on, critical
!> stretches of scenes, and a crack that grows at Gc.
module test_set_up_toughness
  use bodies, only: expect_true
  use comparisons, only: expect_close, text_of
  use pd_base_kinds, only: wp
  use pd_family_volume, only: volume_linear, volume_rule_type
  use pd_law_material, only: critical_stretch_from_energy
  use pd_law_weighted, only: state_based_law, weighted_law_type
  use pd_set_up_prepare, only: set_up_type
  use pd_set_up_toughness_grow, only: grow_crack, subject_type, toughness_type
  use pd_set_up_toughness_table, only: row_type, rows
  use perifort, only: answer_type, fault_type => error_type, read_scene_text, run_options_type, &
    & run_scene, scene_type
  use runs, only: ready_text
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use test_scene_expect, only: expect_fault, line
  implicit none (type, external)
  private
  public :: collect_set_up_toughness

  character(*), parameter :: body = '&body lower = 0, 0 upper = 20, 10 points = 20, 10 /'//line
  character(*), parameter :: rest = "&time method = 'relaxation' /"//line
  character(*), parameter :: plane = '&scene dimension = 2 thickness = 1.0 /'//line//body//rest

contains

  subroutine collect_set_up_toughness(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('long: rows of the table are what solves give', test_rows), &
      & new_unittest('long: rows of 3D', test_rows_3d), &
      & new_unittest('the size of the disc does not matter', test_size), &
      & new_unittest('plane strain is plane stress of another ratio', test_planes), &
      & new_unittest('critical stretches of scenes', test_scenes), &
      & new_unittest('where the formula stays', test_formula_stays), &
      & new_unittest('keys that contradict each other', test_refusals), &
      & new_unittest('a crack grows at Gc', test_growth)]
  end subroutine collect_set_up_toughness

  !> Rows are written by a solve that shares no line with the program (cases/toughness), with four
  !> decimals: half a unit of the last one, and 2e-4 for the residuals of both.
  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: i, checked

    checked = 0
    do i = 1, size(rows)
      if (rows(i)%dim /= 2 .or. rows(i)%horizon > 3.5_wp) cycle
      ! bond-based with every volume correction, and with both signs of a
      if (.not. (abs(rows(i)%poissons_ratio - 1/3.0_wp) < 1.0e-9_wp .or. &
        & abs(rows(i)%poissons_ratio - 0.2_wp) < 1.0e-9_wp .or. &
        & abs(rows(i)%poissons_ratio - 2/3.0_wp) < 1.0e-9_wp)) cycle
      checked = checked + 1
      call expect_row(rows(i), error)
      if (allocated(error)) return
    end do
    call check(error, checked, 6)
  end subroutine test_rows

  subroutine test_rows_3d(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    do i = 1, size(rows)
      if (rows(i)%dim /= 3 .or. abs(rows(i)%poissons_ratio - 0.25_wp) > 1.0e-9_wp) cycle
      call expect_row(rows(i), error)
      return
    end do
    call test_failed(error, 'no row of 3D with nu = 1/4')
  end subroutine test_rows_3d

  !> A row against a solve.
  subroutine expect_row(row, error)
    type(row_type), intent(in) :: row
    type(error_type), allocatable, intent(inout) :: error
    real(wp), parameter :: tolerance = 2.5e-4_wp
    type(toughness_type) :: straight, diagonal

    if (allocated(error)) return
    call grow_crack(law_of(row%poissons_ratio), subject_type(row%dim, .false., &
      & volume_rule_type(row%volume, row%horizon), .true.), .false., straight)
    call expect_true(error, straight%known, 'the crack grows')
    call expect_close(error, straight%largest, row%largest, tolerance, 'largest')
    call expect_close(error, straight%mean, row%mean, tolerance, 'mean')
    call grow_crack(law_of(row%poissons_ratio), subject_type(row%dim, .false., &
      & volume_rule_type(row%volume, row%horizon), .true.), .true., diagonal)
    call expect_close(error, diagonal%largest, row%diagonal, tolerance, 'at 45 degrees')
  end subroutine expect_row

  !> The law of the chapter with a Poisson's ratio.
  function law_of(ratio) result(law)
    real(wp), intent(in) :: ratio
    type(weighted_law_type) :: law
    law = state_based_law()
    law%material%poissons_ratio = ratio
  end function law_of

  !> The tip of the field may be a fraction of a spacing from that of the crack, which changes G by
  !> about 2.7 of that fraction over the radius: within 1 % from 28 to 40 spacings.
  subroutine test_size(error)
    type(error_type), allocatable, intent(out) :: error
    type(toughness_type) :: usual, larger
    type(subject_type) :: subject

    subject%rule = volume_rule_type(volume_linear, 3.015_wp)
    call grow_crack(law_of(0.2_wp), subject, .false., usual)
    call grow_crack(law_of(0.2_wp), subject, .false., larger, radius=40.0_wp)
    call expect_true(error, larger%known, 'the crack grows')
    call expect_close(error, larger%largest, usual%largest, 0.01_wp*usual%largest, 'largest')
    call expect_close(error, larger%mean, usual%mean, 0.01_wp*usual%mean, 'mean')
    call check(error, size(larger%rates) >= 36 .and. size(usual%rates) >= 36, &
      & 'two periods of 18 bonds')
  end subroutine test_size

  !> The moduli in the plane of plane strain at nu are those of plane stress at nu/(1 - nu) with
  !> E/(1 - nu^2), and so is the field of K.
  subroutine test_planes(error)
    type(error_type), allocatable, intent(out) :: error
    type(toughness_type) :: stress, strain
    type(subject_type) :: subject

    subject%rule = volume_rule_type(volume_linear, 3.015_wp)
    call grow_crack(law_of(3/7.0_wp), subject, .false., stress)
    subject%plane_strain = .true.
    call grow_crack(law_of(0.3_wp), subject, .false., strain)
    call expect_close(error, strain%largest, stress%largest, 1.0e-5_wp, 'largest')
    call expect_close(error, strain%mean, stress%mean, 1.0e-5_wp, 'mean')
  end subroutine test_planes

  !> The formula's number, over the root of the table's.
  subroutine test_scenes(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: keys = "&material model = 'bond_based' youngs_modulus = 3.0e9 "// &
      & 'critical_energy_release_rate = 100.0 '
    type(set_up_type) :: set_up
    real(wp) :: formula

    call ready_text(plane//keys//"critical = 'chapter' /", set_up, error)
    if (allocated(error)) return
    associate (m => set_up%system%model%materials(1))
      formula = critical_stretch_from_energy(m, 100.0_wp, 2, 3.015_wp)
      call expect_close(error, m%critical_stretch, formula, 0.0_wp, 'the formula, to the last bit')
      call expect_close(error, m%toughness, 0.0_wp, 0.0_wp, 'no toughness')
    end associate
    call ready_text(plane//keys//"/", set_up, error)
    if (allocated(error)) return
    associate (m => set_up%system%model%materials(1))
      call expect_close(error, m%toughness, 1.5189_wp, 1.0e-4_wp, 'toughness')
      call expect_close(error, m%critical_stretch, formula/sqrt(m%toughness), 1.0e-15_wp, 'lattice')
      call expect_close(error, maxval(set_up%system%model%critical), m%critical_stretch, 0.0_wp, &
        & 'of the points')
      call expect_close(error, set_up%system%model%laws(1)%law%material%critical_stretch, &
        & m%critical_stretch, 0.0_wp, 'of the law')
    end associate
    call ready_text("&scene dimension = 2 thickness = 1.0 defaults = '0.1' /"//line//body//rest// &
      & keys//"/", set_up, error)
    if (allocated(error)) return
    call expect_close(error, set_up%system%model%materials(1)%critical_stretch, formula, 0.0_wp, &
      & 'version 0.1 has the formula')
    call ready_text(plane//keys//"/"//line//"&horizon ratio = 2.6 /", set_up, error)
    if (allocated(error)) return
    call expect_true(error, index(set_up%notes%text(), 'is not in the table') > 0, 'solved anew')
    call expect_true(error, set_up%system%model%materials(1)%toughness > 1.0_wp, 'and found')
  end subroutine test_scenes

  !> Bars, clouds and grids of two spacings, long horizons and other laws keep the formula, and a
  !> note tells why.
  subroutine test_formula_stays(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: head = '&scene dimension = 2 thickness = 1.0 /'//line
    character(*), parameter :: solid = '&material youngs_modulus = 3.0e9 poissons_ratio = 0.2 '// &
      & 'critical_energy_release_rate = 100.0 '

    call expect_note('&scene dimension = 1 area = 1.0 /'//line//'&body lower = 0 upper = 20 '// &
      & 'points = 20 /'//line//rest//solid//'/', 'a bar has no crack that grows')
    call expect_note(plane//solid//'/'//line//'&horizon ratio = 8.0 /', 'of at most 6.5 spacings')
    call expect_note(plane//solid//"model = 'lps' /", "not solved for model = 'lps'")
    call expect_note(head//rest//"&horizon length = 3.015 /"//line//body//solid//'/'//line// &
      & '&body lower = 40, 0 upper = 50, 10 points = 20, 20 /', 'spacings differ')

  contains

    subroutine expect_note(text, note)
      character(*), intent(in) :: text, note
      type(set_up_type) :: set_up

      if (allocated(error)) return
      call ready_text(text, set_up, error)
      if (allocated(error)) return
      call expect_true(error, index(set_up%notes%text(), "critical = 'chapter', since ") > 0 .and. &
        & index(set_up%notes%text(), note) > 0, 'no note of '//note//': '//set_up%notes%text())
      associate (law => set_up%system%model%laws(1)%law)
        call expect_close(error, law%material%critical_stretch, law%critical_stretch(100.0_wp), &
          & 0.0_wp, 'the formula stays')
      end associate
    end subroutine expect_note
  end subroutine test_formula_stays

  subroutine test_refusals(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: keys = '&material youngs_modulus = 3.0e9 poissons_ratio = 0.2 '

    call expect_fault(error, plane//keys//"critical = 'lattice' /", &
      & "'critical' without 'critical_energy_release_rate'|a/b.nml:4")
    call expect_fault(error, plane//keys//"critical = 'chapter' critical_stretch = 0.01 /", &
      & "'critical' without 'critical_energy_release_rate'|a given 'critical_stretch' holds")
    call expect_fault(error, plane//keys//"critical = 'book' critical_energy_release_rate = 1 /", &
      & "unknown value 'book' of key 'critical'|allowed: lattice, chapter")
  end subroutine test_refusals

  !> A square whose rim has the field of K around the centre, and a crack to there. A solve of the
  !> disc says that a crack from a straight cut needs 1.37/1.52 of G to come through the first
  !> spacing, 18 bonds; and where the field stays behind by x spacings, G falls by about 0.06 x: at
  !> 1.2 Gc it comes through two spacings, at 0.8 Gc, or with the formula's s_c at 1.2, not through
  !> one.
  subroutine test_growth(error)
    type(error_type), allocatable, intent(out) :: error

    call expect_broken('lattice', 0.8_wp, least=1, most=17)
    call expect_broken('lattice', 1.2_wp, least=36, most=200)
    call expect_broken('chapter', 1.2_wp, least=1, most=17)

  contains

    !> Bonds that break under the field of G/Gc = `rate`.
    subroutine expect_broken(critical, rate, least, most)
      character(*), intent(in) :: critical
      real(wp), intent(in) :: rate
      integer, intent(in) :: least, most
      character(30) :: amplitude
      character(:), allocatable :: field, text
      type(scene_type) :: scene
      type(answer_type) :: answer
      type(run_options_type) :: options
      type(fault_type), allocatable :: fault
      real(wp), allocatable :: broken(:)

      if (allocated(error)) return
      ! K sqrt(r/(2 pi))/(2 mu) (kappa - cos) with E = 1e9, nu = 1/3: mu = 3.75e8, kappa = 2;
      ! Gc = 1 J/m2, K = sqrt(E G)
      write (amplitude, '(es23.16)') sqrt(1.0e9_wp*rate/(2*acos(-1.0_wp)))/(2*3.75e8_wp)
      field = trim(adjustl(amplitude))//'*sqrt(sqrt(x^2+y^2))*(2-cos(atan2(y,x)))*'
      text = '&scene dimension = 2 thickness = 1.0 /'//line// &
        & '&body lower = -32, -32 upper = 32, 32 points = 64, 64 /'//line// &
        & "&material model = 'bond_based' youngs_modulus = 1.0e9 critical = '"//critical// &
        & "' critical_energy_release_rate = 1.0 /"//line// &
        & "&region name = 'rim' where = 'sqrt(x^2+y^2) > 28' /"//line// &
        & "&boundary region = 'rim' displacement_x = '"//field//"cos(atan2(y,x)/2)' "// &
        & "displacement_y = '"//field//"sin(atan2(y,x)/2)' /"//line// &
        & "&no_fail region = 'rim' /"//line// &
        & '&crack from = -33, 0 to = 0, 0 /'//line//rest// &
        & '&relaxation load_steps = 1 tolerance = 1e-5 /'
      options%files = .false.
      options%quiet = .true.
      call read_scene_text(text, '', scene, fault)
      if (.not. allocated(fault)) call run_scene(scene, options, fault, answer=answer)
      if (.not. allocated(fault)) call answer%get_column('broken_bonds', broken, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call expect_true(error, nint(broken(size(broken))) >= least .and. &
        & nint(broken(size(broken))) <= most, critical//' at '//text_of(rate)//' Gc: '// &
        & text_of(broken(size(broken)))//' bonds break')
    end subroutine expect_broken
  end subroutine test_growth

end module test_set_up_toughness
