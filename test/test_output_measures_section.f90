!> Force and moment carried across sections, against the statics of the part that they cut off.
module test_output_measures_section
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_driver, only: run_scene
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_answer, only: answer_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use bodies, only: expect_true
  use comparisons, only: expect_close, max_abs
  use test_scene_expect, only: expect_fault, expect_parts, good_head, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_measures_section

  character(*), parameter :: rest = "&time method = 'relaxation' /"//line// &
    & "&relaxation tolerance = 1e-11 /"//line//"&output fields = 'displacement' /"//line
  real(wp), parameter :: solved = 1.0e-8_wp  !! tolerance of the solver's, with a margin for moments

contains

  subroutine collect_output_measures_section(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a bar of two materials carries its load', test_bar), &
      & new_unittest('a cantilever: force and moment of its end load', test_cantilever), &
      & new_unittest('parts of a section add up', test_parts), &
      & new_unittest('a heated plate between walls', test_heated), &
      & new_unittest('a block in space under a force out of all planes', test_block), &
      & new_unittest('plastic bonds carry the load, too', test_plastic), &
      & new_unittest('nothing is carried across a crack', test_crack), &
      & new_unittest('the same bits on one and two threads', test_threads), &
      & new_unittest('sections that cannot be had', test_wrong)]
  end subroutine collect_output_measures_section

  !> Run a scene without files.
  subroutine solve(error, text, answer, threads)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text
    type(answer_type), intent(out) :: answer
    integer, intent(in), optional :: threads
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    integer :: before

    if (allocated(error)) return
    call read_scene_text(text, 'section.nml', scene, fault)
    options%files = .false.
    options%quiet = .true.
    options%threads = 1
    if (present(threads)) options%threads = threads
    before = omp_get_max_threads()
    if (.not. allocated(fault)) call run_scene(scene, options, fault, answer=answer)
    call omp_set_num_threads(before)
    if (allocated(fault)) call test_failed(error, 'refused: '//fault%message)
  end subroutine solve

  !> The last value of a column.
  real(wp) function last(error, answer, name)
    type(error_type), allocatable, intent(inout) :: error
    type(answer_type), intent(in) :: answer
    character(*), intent(in) :: name
    real(wp), allocatable :: values(:)
    type(fault_type), allocatable :: fault

    last = 0.0_wp
    if (allocated(error)) return
    call answer%get_column(name, values, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
    else
      last = values(size(values))
    end if
  end function last

  subroutine test_bar(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    character(*), parameter :: bar = '&scene dimension = 1 area = 2e-6 /'//line// &
      & "&material name = 'a' youngs_modulus = 2e11 density = 8e3 /"//line// &
      & "&material name = 'b' youngs_modulus = 7e10 density = 3e3 /"//line// &
      & "&body name = 'one' lower = 0 upper = 0.3 points = 30 material = 'a' /"//line// &
      & "&body name = 'two' lower = 0.3 upper = 0.6 points = 30 material = 'b' /"//line// &
      & "&boundary name = 'wall' side = 'x_min' displacement_x = 0 /"//line// &
      & "&load body = 'two' side = 'x_max' force_x = 123 /"//line
    character(*), parameter :: names(3) = ['one  ', 'joint', 'layer']
    integer :: i

    call solve(error, bar//"&section name = 'one' point = 0.105 /"//line// &
      & "&section name = 'joint' point = 0.3 normal = -3 /"//line// &
      & "&section name = 'layer' point = 0 /"//line//rest, answer)
    do i = 1, size(names)
      call expect_close(error, last(error, answer, trim(names(i))//'_force_x'), &
        & merge(-123.0_wp, 123.0_wp, names(i) == 'joint'), 123*solved, 'section '//names(i))
    end do
    call expect_close(error, last(error, answer, 'wall_reaction_x'), -123.0_wp, 123*solved, 'wall')
    call expect_true(error, answer%column_number('one_force_y') == 0 .and. &
      & answer%column_number('one_moment_z') == 0, 'a bar has neither shear nor moment')
  end subroutine test_bar

  !> A cantilever 0.4 x 0.1 m, held at x_min, with a force at its end.
  function cantilever(material) result(text)
    character(*), intent(in) :: material
    character(:), allocatable :: text
    text = '&scene dimension = 2 thickness = 0.01 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 '//material//' /'//line// &
      & "&body name = 'beam' lower = 0, 0 upper = 0.4, 0.1 points = 40, 10 /"//line// &
      & "&boundary name = 'wall' side = 'x_min' displacement_x = 0 displacement_y = 0 /"//line// &
      & "&load side = 'x_max' force_x = 4e4 force_y = -5e4 /"//line//rest
  end function cantilever

  !> Where the end load acts: the mean place of the outermost points, deformed [m].
  subroutine place_of_load(error, answer, place)
    type(error_type), allocatable, intent(inout) :: error
    type(answer_type), intent(in) :: answer
    real(wp), intent(out) :: place(3)
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :)
    integer :: i

    place = 0.0_wp
    if (allocated(error)) return
    call answer%get_field('displacement', u, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    associate (x => answer%positions)
      do i = 1, size(x, 1)
        if (x(i, 1) > maxval(x(:, 1)) - 1.0e-6_wp) place = place + x(i, :) + u(i, :)
      end do
      place = place/count(x(:, 1) > maxval(x(:, 1)) - 1.0e-6_wp)
    end associate
  end subroutine place_of_load

  subroutine test_cantilever(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    character(*), parameter :: sections = &
      & "&section name = 'mid' point = 0.203, 0.05 normal = 1, 0 /"//line// &
      & "&section name = 'on' point = 0.205, 0.02 normal = 2, 0 /"//line// &
      & "&section name = 'slant' point = 0.2, 0.03 normal = 1, 0.7 /"//line// &
      & "&section name = 'root' point = 0, 0.05 normal = -1, 0 /"//line
    character(72), parameter :: materials(4) = [character(72) :: "poissons_ratio = 0.3", &
      & "model = 'lps' poissons_ratio = 0.2", "model = 'bond_based' influence = 'gaussian'", &
      & "model = 'softening' critical_stretch = 0.5 peak_stretch = 0.3"]
    real(wp) :: place(3)
    integer :: m

    do m = 1, size(materials)
      call solve(error, cantilever(trim(materials(m)))//sections, answer)
      call place_of_load(error, answer, place)
      call one_of('mid', [0.203_wp, 0.05_wp], 1.0_wp)
      call one_of('on', [0.205_wp, 0.02_wp], 1.0_wp)
      call one_of('slant', [0.2_wp, 0.03_wp], 1.0_wp)
      call one_of('root', [0.0_wp, 0.05_wp], -1.0_wp)
      if (allocated(error)) return
    end do

  contains

    !> The part ahead is in equilibrium with the load.
    subroutine one_of(name, point, sense)
      character(*), intent(in) :: name
      real(wp), intent(in) :: point(2), sense
      character(:), allocatable :: what

      what = name//', '//trim(materials(m))
      call expect_close(error, last(error, answer, name//'_force_x'), sense*4.0e4_wp, &
        & 5.0e4_wp*solved, 'axial force, '//what)
      call expect_close(error, last(error, answer, name//'_force_y'), -sense*5.0e4_wp, &
        & 5.0e4_wp*solved, 'shear force, '//what)
      call expect_close(error, last(error, answer, name//'_moment_z'), &
        & sense*((place(1) - point(1))*(-5.0e4_wp) - (place(2) - point(2))*4.0e4_wp), &
        & 2.0e4_wp*solved, 'moment, '//what)
    end subroutine one_of
  end subroutine test_cantilever

  subroutine test_parts(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    character(*), parameter :: columns(3) = [character(8) :: 'force_x', 'force_y', 'moment_z']
    real(wp) :: low, high, whole
    integer :: c

    call solve(error, cantilever('poissons_ratio = 0.3')// &
      & "&section name = 'low' point = 0.2, 0.05 normal = 1, 0 upper = 1, 0.05 /"//line// &
      & "&section name = 'high' point = 0.2, 0.05 normal = 1, 0 lower = -1, 0.05 /"//line// &
      & "&section name = 'whole' point = 0.2, 0.05 normal = 1, 0 /"//line, answer)
    do c = 1, size(columns)
      low = last(error, answer, 'low_'//trim(columns(c)))
      high = last(error, answer, 'high_'//trim(columns(c)))
      whole = last(error, answer, 'whole_'//trim(columns(c)))
      call expect_close(error, low + high, whole, 1.0e-12_wp*(abs(low) + abs(high)), &
        & 'the sum, '//columns(c))
    end do
    ! bending by a force downwards presses the lower half
    call expect_true(error, last(error, answer, 'low_force_x') < 0.0_wp .and. &
      & last(error, answer, 'high_force_x') > 4.0e4_wp, 'halves of a bent beam')
  end subroutine test_parts

  subroutine test_heated(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    real(wp) :: left

    call solve(error, '&scene dimension = 2 thickness = 0.01 /'//line// &
      & "&material name = 'a' youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 "// &
      & 'thermal_expansion = 1e-5 /'//line// &
      & "&material name = 'b' youngs_modulus = 7e10 density = 8e3 poissons_ratio = 0.2 "// &
      & 'thermal_expansion = 2e-5 /'//line// &
      & "&body name = 'one' lower = 0, 0 upper = 0.1, 0.1 points = 10, 10 material = 'a' /"// &
      & line//"&body name = 'two' lower = 0.1, 0 upper = 0.2, 0.1 points = 10, 10 "// &
      & "material = 'b' /"//line//"&initial temperature_change = 100 /"//line// &
      & "&boundary name = 'left' side = 'x_min' displacement_x = 0 displacement_y = 0 /"//line// &
      & "&boundary name = 'right' side = 'x_max' displacement_x = 0 /"//line// &
      & "&section name = 'one' point = 0.05, 0.05 normal = 1, 0 /"//line// &
      & "&section name = 'joint' point = 0.1, 0.05 normal = 1, 0 /"//line//rest, answer)
    left = last(error, answer, 'left_reaction_x')
    ! between rigid walls: E alpha dT of a bar, within what Poisson's ratios and surfaces change
    call expect_true(error, left > 0.5e5_wp .and. left < 4.0e5_wp, 'the walls press')
    call expect_close(error, last(error, answer, 'one_force_x'), -left, left*solved, 'one')
    call expect_close(error, last(error, answer, 'joint_force_x'), -left, left*solved, 'joint')
    call expect_close(error, last(error, answer, 'right_reaction_x'), -left, left*solved, 'right')
  end subroutine test_heated

  !> A block in space, held at z_min, with a force at z_max.
  function block(material) result(text)
    character(*), intent(in) :: material
    character(:), allocatable :: text
    text = '&scene dimension = 3 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 '//material//' /'//line// &
      & "&body name = 'block' lower = 0, 0, 0 upper = 0.05, 0.04, 0.08 points = 5, 4, 8 /"//line// &
      & "&boundary name = 'floor' side = 'z_min' displacement_x = 0 displacement_y = 0 "// &
      & 'displacement_z = 0 /'//line// &
      & "&load side = 'z_max' force_x = 3e3 force_y = -2e3 force_z = 1e4 /"//line// &
      & "&section name = 'cut' point = 0.01, 0.02, 0.045 normal = 0, 0.2, 1 /"//line// &
      & "&output fields = 'displacement' /"//line//"&time method = 'relaxation' /"//line
  end function block

  subroutine test_block(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :)
    real(wp), parameter :: load(3) = [3.0e3_wp, -2.0e3_wp, 1.0e4_wp]
    real(wp) :: arm(3), moment(3)
    logical, allocatable :: top(:)
    integer :: c

    call solve(error, block('poissons_ratio = 0.3')//'&relaxation tolerance = 1e-11 /'//line, &
      & answer)
    if (allocated(error)) return
    call answer%get_field('displacement', u, fault)
    allocate (top(size(u, 1)))
    top = answer%positions(:, 3) > 0.074_wp
    arm = sum(answer%positions + u, dim=1, mask=spread(top, 2, 3))/count(top) &
      & - [0.01_wp, 0.02_wp, 0.045_wp]
    moment = [arm(2)*load(3) - arm(3)*load(2), arm(3)*load(1) - arm(1)*load(3), &
      & arm(1)*load(2) - arm(2)*load(1)]
    do c = 1, 3
      call expect_close(error, last(error, answer, 'cut_force_'//'xyz'(c:c)), load(c), &
        & 1.0e4_wp*solved, 'force '//'xyz'(c:c))
      call expect_close(error, last(error, answer, 'cut_moment_'//'xyz'(c:c)), moment(c), &
        & 500*solved, 'moment '//'xyz'(c:c))
    end do
  end subroutine test_block

  subroutine test_plastic(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer
    integer :: c

    call solve(error, block("model = 'lps_plastic' poissons_ratio = 0.3 "// &
      & 'yield_stress = 1e7 hardening = 4e10')//'&relaxation tolerance = 1e-8 /'//line, answer)
    call expect_true(error, last(error, answer, 'plastic_energy') > 0.0_wp, 'nothing yields')
    do c = 1, 3
      call expect_close(error, last(error, answer, 'cut_force_'//'xyz'(c:c)), &
        & -last(error, answer, 'floor_reaction_'//'xyz'(c:c)), 1.0e4_wp*1.0e-6_wp, &
        & 'force '//'xyz'(c:c))
    end do
  end subroutine test_plastic

  !> A plate that a crack cuts in two, each held by a side of its own: nothing holds the parts
  !> together, whatever is pulled.
  subroutine test_crack(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: answer

    call solve(error, '&scene dimension = 2 thickness = 0.01 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.3 /'//line// &
      & "&body name = 'plate' lower = 0, 0 upper = 0.2, 0.1 points = 20, 10 /"//line// &
      & '&crack from = 0.1, -1 to = 0.1, 1 /'//line// &
      & "&boundary name = 'left' side = 'x_min' displacement_x = 0 displacement_y = 0 /"//line// &
      & "&boundary name = 'right' side = 'x_max' displacement_x = 1e-4 displacement_y = 0 /"// &
      & line//"&section name = 'cut' point = 0.1, 0.05 normal = 1, 0 /"//line//rest, answer)
    call expect_close(error, last(error, answer, 'cut_force_x'), 0.0_wp, 0.0_wp, 'force')
    call expect_close(error, last(error, answer, 'cut_moment_z'), 0.0_wp, 0.0_wp, 'moment')
  end subroutine test_crack

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(answer_type) :: one, two
    character(*), parameter :: wave = '&scene dimension = 2 /'//line// &
      & '&material youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.3 /'//line// &
      & "&body name = 'plate' lower = 0, 0 upper = 1, 0.5 points = 100, 50 /"//line// &
      & "&initial velocity_x = 3 velocity_y = 1 region = 'left' /"//line// &
      & "&region name = 'left' shape = 'box' upper = 0.3, 1 /"//line// &
      & '&time steps = 20 /'//line//"&output history_every = 1 fields = 'displacement' /"//line// &
      & "&section name = 'cut' point = 0.31, 0.2 normal = 1, 0.3 /"//line

    call solve(error, wave, one, threads=1)
    call solve(error, wave, two, threads=2)
    if (allocated(error)) return
    call expect_true(error, max_abs(one%history(:, one%column_number('cut_force_x'))) &
      & > 1.0_wp, 'no wave crosses the section')
    call expect_close(error, one%history, two%history, 0.0_wp, 'the history')
  end subroutine test_threads

  subroutine test_wrong(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault

    call expect_fault(error, good_head//'&time steps = 5 /'//line// &
      & "&section name = 'a' point = 0.5, 0.2 normal = 0, 0 /", "'normal' has no length")
    if (allocated(error)) return
    call expect_fault(error, good_head//'&time steps = 5 /'//line// &
      & "&section name = 'a' point = 0.5, 0.2 /", "lacks the key 'normal'")
    if (allocated(error)) return
    call expect_fault(error, good_head//'&time steps = 5 /'//line// &
      & "&section name = 'a' point = 0.5, 0.2 normal = 1, 0 /"//line// &
      & "&section name = 'a' point = 0.7, 0.2 normal = 1, 0 /", 'is used by another &section')
    if (allocated(error)) return
    call expect_fault(error, good_head//'&time steps = 5 /'//line// &
      & "&section name = 'a' point = 0.5, 0.2 normal = 1, 0 lower = 1, 0 upper = 0, 1 /", &
      & "'upper' is not above 'lower' along x")
    if (allocated(error)) return
    call read_scene_text(good_head//'&time steps = 5 /'//line// &
      & "&section name = 'far' point = 2, 0.2 normal = 1, 0 /", 'a.nml', scene, fault)
    options%files = .false.
    options%quiet = .true.
    if (.not. allocated(fault)) call run_scene(scene, options, fault)
    call expect_parts(error, fault, "section 'far' is crossed by no bond|&section|point = 2")
  end subroutine test_wrong

end module test_output_measures_section
