!> The table of output fields: its entries, names that it does not have, and fields that are added
!> from outside to one run.
module test_output_fields_table
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc
  use pd_base_error, only: fault_type => error_type, status_input
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_text, only: to_text
  use pd_driver, only: run_scene
  use pd_preview, only: preview_scene
  use pd_output_fields_field, only: output_field_type, rank_symmetric
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_base64, only: base64_encoder, base64_length
  use pd_output_results_datasets, only: get_shape, read_rows
  use pd_output_results_files, only: file_exists, make_directory
  use pd_output_results_hdf5, only: close_file, hdf5_file, open_file
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: name_length, scene_type
  use pd_scene_format_file, only: line_type, read_text_file
  use pd_study_trade_measure, only: quantity_unit
  use pd_study_trade_study, only: begin_study, run_all, session_type
  use pd_study_trade_table, only: put_file
  use bodies, only: density_of_steel, expect, expect_true
  use comparisons, only: expect_close
  use own_fields, only: momentum_flux_field, motion_energy_field, never_field
  use test_scene_expect, only: expect_parts, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_output_fields_table

  character(*), parameter :: here = 'build/test_fields'
  integer, parameter :: points = 30

  !> A plate of 6 x 5 points that flies at (3, -2) m/s, so that no bond is strained.
  character(*), parameter :: steel = '&material youngs_modulus = 200.0e9 poissons_ratio = 0.25 '// &
    & 'density = 7850.0 '
  character(*), parameter :: plate = '&scene dimension = 2 /'//line// &
    & "&body lower = 0.0, 0.0 upper = 0.6, 0.5 points = 6, 5 /"//line// &
    & '&initial velocity_x = 3.0 velocity_y = -2.0 /'//line
  character(*), parameter :: flight = plate//'&time step = 1.0e-6 duration = 4.0e-6 /'//line// &
    & steel//'/'//line
  character(*), parameter :: brittle = plate//'&time step = 1.0e-6 duration = 4.0e-6 /'//line// &
    & steel//'critical_stretch = 0.1 /'//line
  real(wp), parameter :: energy = density_of_steel*(3.0_wp**2 + 2.0_wp**2)/2  !! [J/m3]
  real(wp), parameter :: flux(3) = density_of_steel*[9.0_wp, 4.0_wp, -6.0_wp] !! xx, yy, xy [Pa]

contains

  subroutine collect_output_fields_table(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('every field is described', test_described), &
      & new_unittest('components and their names', test_components), &
      & new_unittest('a name that no field has', test_unknown), &
      & new_unittest('a field that the run cannot have', test_lack), &
      & new_unittest('a field of a test''s own in files and probes', test_own), &
      & new_unittest('a field of a test''s own in a study', test_study)]
  end subroutine collect_output_fields_table

  subroutine test_described(error)
    type(error_type), allocatable, intent(out) :: error
    type(field_table_type) :: table
    type(output_field_type) :: field
    type(fault_type), allocatable :: fault
    character(name_length), allocatable :: names(:)
    character(:), allocatable :: guide
    integer :: i

    table = all_fields()
    names = table%names()
    call expect_true(error, size(names) >= 6, 'fields are missing')
    do i = 1, size(names)
      field = table%field(names(i))
      call expect_true(error, table%number_of(names(i)) == i .and. field%name == names(i) .and. &
        & field%unit /= '' .and. field%meaning /= '' .and. (associated(field%fill) .or. &
        & associated(field%of_gradient)), &
        & 'the entry of '//trim(names(i)))
    end do
    call read_text_file('doc/user-guide.md', guide, fault)
    do i = 1, merge(0, size(names), allocated(fault))  ! not run in the project's folder
      field = table%field(names(i))
      call expect_true(error, index(guide, line//'| `'//trim(field%name)//'` | '// &
        & trim(field%unit)//' | '//trim(field%meaning)//' |'//line) > 0, &
        & 'the user guide has no row for the field '//trim(names(i)))
    end do
  end subroutine test_described

  subroutine test_components(error)
    type(error_type), allocatable, intent(out) :: error
    type(field_table_type) :: table
    type(output_field_type) :: field, tensor
    character(*), parameter :: expected(3) = [character(17) :: 'xx', 'xx yy xy', &
      & 'xx yy zz xy yz xz']
    character(20) :: names
    integer :: component, c, dim
    logical :: found

    table = all_fields()
    call table%add(momentum_flux_field())
    tensor = momentum_flux_field()
    do dim = 1, 3
      names = ''
      do c = 1, tensor%components(dim)
        names = trim(names)//' '//tensor%component_name(c, dim)
      end do
      call expect_true(error, adjustl(names) == expected(dim), names)
    end do
    call table%find_component('velocity_y', 2, field, component, found)
    call expect_true(error, found .and. field%name == 'velocity' .and. component == 2, 'velocity_y')
    call table%find_component('velocity_y', 1, field, component, found)
    call expect_true(error, .not. found, 'velocity_y in 1D')
    call table%find_component('damage_x', 1, field, component, found)
    call expect_true(error, .not. found, 'a component of a scalar')
    call table%find_component('force_density', 3, field, component, found)
    call expect_true(error, found .and. field%name == 'force_density' .and. component == 0, &
      & 'force_density')
    call expect_names(error, 'stress', [character(24) :: 'xx', 'xx yy zz xy', &
      & 'xx yy zz xy yz xz'])
    call expect_names(error, 'deformation_gradient', [character(26) :: 'xx', 'xx xy yx yy', &
      & 'xx xy xz yx yy yz zx zy zz'])
    call expect_names(error, 'principal_stress', [character(5) :: '1 2 3', '1 2 3', '1 2 3'])
    call table%find_component('momentum_flux_xy', 3, field, component, found)
    call expect_true(error, found .and. field%rank == rank_symmetric .and. component == 4, &
      & 'momentum_flux_xy')
  end subroutine test_components

  !> The names of all components of a field of the program, by dimension.
  subroutine expect_names(error, name, expected)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: name
    character(*), intent(in) :: expected(3)
    type(field_table_type) :: table
    type(output_field_type) :: field
    character(40) :: names
    integer :: c, dim

    table = all_fields()
    field = table%field(name)
    do dim = 1, 3
      names = ''
      do c = 1, field%components(dim)
        names = trim(names)//' '//field%component_name(c, dim)
      end do
      call expect_true(error, adjustl(names) == expected(dim), name//': '//names)
    end do
  end subroutine expect_names

  !> Run or check a scene with fields of a table; threads are as before afterwards.
  subroutine compute(text, name, table, fault, only_check)
    character(*), intent(in) :: text, name
    type(field_table_type), intent(in) :: table
    type(fault_type), allocatable, intent(out) :: fault
    logical, intent(in), optional :: only_check
    type(scene_type) :: scene
    type(run_options_type) :: options
    integer :: threads

    call read_scene_text(text, name//'.nml', scene, fault)
    if (allocated(fault)) return
    options%output_directory = here//'/'//name
    options%quiet = .true.
    options%overwrite = .true.
    options%threads = 1
    options%fields = table
    threads = omp_get_max_threads()
    if (present(only_check)) then
      call preview_scene(scene, options, fault)
    else
      call run_scene(scene, options, fault)
    end if
    call omp_set_num_threads(threads)
  end subroutine compute

  !> The place of the name, the nearest one and all of them, before there are any files.
  subroutine test_unknown(error)
    type(error_type), allocatable, intent(out) :: error
    type(fault_type), allocatable :: fault
    type(field_table_type) :: more

    call compute(flight//"&output fields = 'damage',"//line//"  'Velocty' /", 'unknown', &
      & all_fields(), fault)
    call expect_parts(error, fault, "unknown value 'velocty' of key 'fields' in group &output|"// &
      & "unknown.nml:7|'Velocty'|    |   ^^^^^^^^^ did you mean 'velocity'?  allowed: "// &
      & 'displacement, velocity, damage, dilatation, force_density, energy_density')
    if (allocated(error)) return
    call expect_true(error, fault%status == status_input .and. &
      & .not. file_exists(here//'/unknown/unknown.vtkhdf'), 'status and files')
    call compute(flight//"&probe name = 'a' point = 0, 0 /"//line// &
      & "&probe name = 'b' point = 0, 0 fields = 'entropy' /", 'unknown', all_fields(), fault, &
      & only_check=.true.)
    if (.not. allocated(error)) call expect_parts(error, fault, &
      & "unknown value 'entropy' of key 'fields' in group &probe|unknown.nml:7|allowed: "// &
      & 'displacement')
    if (allocated(error)) return
    more = all_fields()
    call more%add(motion_energy_field())
    call compute(flight//"&output fields = 'motion_enery' /", 'unknown', more, fault)
    call expect_parts(error, fault, "did you mean 'motion_energy'?")
  end subroutine test_unknown

  subroutine test_lack(error)
    type(error_type), allocatable, intent(out) :: error
    type(fault_type), allocatable :: fault
    type(field_table_type) :: table

    table = all_fields()
    call table%add(never_field())
    call compute(flight//"&output fields = 'age_of_cracks' /", 'lack', table, fault)
    call expect_parts(error, fault, &
      & "this scene has no field 'age_of_cracks'|no bond can break|lack.nml:6|    |  "// &
      & repeat(' ', 16)//'^^^')
    if (allocated(error)) return
    call compute(flight//"&probe name = 'a' point = 0, 0 fields = 'age_of_cracks' /", 'lack', &
      & table, fault, only_check=.true.)
    call expect_parts(error, fault, "this scene has no field 'age_of_cracks'|lack.nml:6")
    if (allocated(error)) return
    call compute(brittle//"&output fields = 'age_of_cracks' /", 'lack', table, fault)
    call accept(error, fault)
  end subroutine test_lack

  !> v is the same everywhere, and its products are known.
  subroutine test_own(error)
    type(error_type), allocatable, intent(out) :: error
    type(fault_type), allocatable :: fault
    type(field_table_type) :: table
    type(hdf5_file) :: file
    character(:), allocatable :: text
    real(wp) :: scalars(2*points), tensors(3, 2*points), column(5)
    integer(i8) :: rows
    integer :: components, c
    character(2), parameter :: pairs(3) = ['xx', 'yy', 'xy']

    table = all_fields()
    call table%add(motion_energy_field())
    call table%add(momentum_flux_field())
    call compute(flight//"&output fields = 'motion_energy', 'momentum_flux', 'damage' "// &
      & "every = 4 history_every = 1 format = 'both' /"//line// &
      & "&probe name = 'p' point = 0, 0 fields = 'momentum_flux', 'motion_energy' /", 'own', &
      & table, fault)
    call accept(error, fault)
    if (allocated(error)) return
    call open_file(here//'/own/own.vtkhdf', .false., file, fault)
    if (.not. allocated(fault)) call get_shape(file, '/VTKHDF/PointData/momentum_flux', &
      & components, rows, fault)
    if (.not. allocated(fault)) call read_rows(file, '/VTKHDF/PointData/motion_energy', 0_i8, &
      & scalars, fault)
    if (.not. allocated(fault)) call read_rows(file, '/VTKHDF/PointData/momentum_flux', 0_i8, &
      & tensors, fault)
    call accept(error, fault)
    call expect_true(error, components == 3 .and. rows == 2*points, 'shape of the tensor')
    call expect_close(error, scalars, energy, 1.0e-9_wp*energy, 'energy')
    do c = 1, 3
      call expect_close(error, tensors(c, :), flux(c), 1.0e-9_wp*energy, pairs(c))
      if (.not. allocated(error)) call read_rows(file, '/history/p_momentum_flux_'//pairs(c), &
        & 0_i8, column, fault)
      call accept(error, fault)
      call expect_close(error, column, flux(c), 1.0e-9_wp*energy, 'p '//pairs(c))
    end do
    if (.not. allocated(error)) call read_rows(file, '/history/p_motion_energy', 0_i8, column, &
      & fault)
    call accept(error, fault)
    call expect_close(error, column, energy, 1.0e-9_wp*energy, 'p energy')
    call close_file(file, fault)
    if (allocated(error)) return
    call read_text_file(here//'/own/own_000001.vtu', text, fault)
    call accept(error, fault)
    call expect_true(error, index(text, 'Name="motion_energy" NumberOfComponents="1" '// &
      & 'format="binary">'//encoded(scalars(points + 1:))) > 0, 'energy in the .vtu')
    call expect_true(error, index(text, 'Name="momentum_flux" NumberOfComponents="3" '// &
      & 'ComponentName0="xx" ComponentName1="yy" ComponentName2="xy" format="binary">'// &
      & encoded(reshape(tensors(:, points + 1:), [3*points]))) > 0, 'tensor in the .vtu')
  end subroutine test_own

  !> Reals as a .vtu holds them: base64 of their number of bytes and of themselves.
  function encoded(values) result(text)
    real(wp), contiguous, target, intent(in) :: values(:)
    character(:), allocatable :: text, buffer
    type(base64_encoder) :: encoder
    integer(i1), pointer, contiguous :: bytes(:)
    integer :: length

    allocate (character(base64_length(8*size(values) + 8)) :: buffer)
    call encoder%put(transfer(8*size(values, kind=i8), [0_i1]), buffer, length)
    text = buffer(:length)
    call c_f_pointer(c_loc(values), bytes, [8*size(values)])
    call encoder%put(bytes, buffer, length)
    text = text//buffer(:length)
    call encoder%finish(buffer, length)
    text = text//buffer(:length)
  end function encoded

  !> What is measured of the fields, at all points and at a probe.
  subroutine test_study(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: measures(5) = [character(18) :: 'motion_energy', &
      & 'momentum_flux_xy', 'p', 'p_momentum_flux_yy', 'momentum_flux']
    character(*), parameter :: units(5) = [character(4) :: 'J/m3', 'Pa', 'J/m3', 'Pa', 'Pa']
    character(*), parameter :: against(5) = [character(20) :: 'finest', 'finest', 'finest', &
      & 'finest', 'whole/whole.vtkhdf']
    ! of a field the root of the mean square over points and components, of a probe its value
    real(wp), parameter :: answers(5) = [energy, -flux(3), energy, flux(2), norm2(flux)]
    type(field_table_type) :: table
    type(session_type) :: session
    type(run_options_type) :: options
    type(fault_type), allocatable :: fault
    integer :: i, threads

    threads = omp_get_max_threads()
    table = all_fields()
    call table%add(motion_energy_field())
    call table%add(momentum_flux_field())
    call make_directory(here, fault)
    call compute(flight//"&output fields = 'momentum_flux' /", 'whole', table, fault)
    do i = 1, size(measures)
      options%output_directory = here//'/study'//to_text(i)
      options%quiet = .true.
      options%overwrite = .true.
      options%threads = 1
      options%fields = table
      if (.not. allocated(fault)) call put_file(here, 'study.nml', flight// &
        & "&probe name = 'p' point = 0, 0 fields = 'motion_energy' /"//line// &
        & "&study vary = 'time%step' values = 1.0e-6, 0.5e-6 measure = '"// &
        & trim(measures(i))//"' against = '"//trim(against(i))//"' norm = 'rms' /"//line, fault)
      if (.not. allocated(fault)) call begin_study(here//'/study.nml', options, session, fault, &
        & [line_type ::])
      if (.not. allocated(fault)) call run_all(session, fault)
      call accept(error, fault)
      if (allocated(error)) exit
      call expect(error, session%outcomes(1)%value, answers(i), 1.0e-9_wp*energy, measures(i))
      call expect(error, session%outcomes(1)%error, 0.0_wp, 1.0e-9_wp*energy, 'error')
      call expect_true(error, quantity_unit(session%measure) == units(i), 'unit of '//measures(i))
    end do
    call omp_set_num_threads(threads)
  end subroutine test_study

  subroutine accept(error, fault)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(in) :: fault
    if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
  end subroutine accept

end module test_output_fields_table
