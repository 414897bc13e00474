!> Every warning has a scene that triggers it and one that must not; so have the notes.
module test_warnings
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_base_text, only: to_text
  use pd_base_warnings, only: warnings_type
  use pd_driver, only: run_scene
  use pd_motion_system, only: system_type
  use pd_output_report_balance, only: balance_type
  use pd_output_report_begin, only: run_options_type
  use pd_set_up_prepare, only: set_up_type
  use pd_output_results_files, only: file_exists, make_directory
  use pd_output_results_sink, only: sink_type
  use pd_scene_format_file, only: read_text_file
  use pd_scene_content_types, only: scene_type
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use perifort, only: read_scene_text
  use bodies, only: expect, prepare_run, box_scene, expect_true
  use surfaces, only: ascii_stl
  implicit none (type, external)
  private
  public :: collect_warnings

  character(*), parameter :: here = 'build/test_warnings'
  real(wp), parameter :: spacing = 1.0e-2_wp

contains

  subroutine collect_warnings(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('bodies one point thick', test_thin), &
      & new_unittest('bodies one point thick in any direction', test_thin_anywhere), &
      & new_unittest('cracks through points', test_cracks), &
      & new_unittest('surfaces through points', test_crack_surfaces), &
      & new_unittest('volumes of a cloud', test_volumes), &
      & new_unittest('horizons without shear stiffness', test_horizons), &
      & new_unittest('stiffness in other units', test_stiffness), &
      & new_unittest('density in other units', test_density), &
      & new_unittest('loads in other units', test_loads), &
      & new_unittest('motions in other units', test_motions), &
      & new_unittest('expressions in other units', test_expressions), &
      & new_unittest('outputs beyond the end', test_schedule), &
      & new_unittest('empty regions and zones', test_empty), &
      & new_unittest('regions that are clamped', test_clamps), &
      & new_unittest('clamps of several groups', test_common_clamps), &
      & new_unittest('what drives a body that can move', test_driven), &
      & new_unittest('energy balance beside what is dissipated', test_dissipated), &
      & new_unittest('heat without expansion', test_idle_heat), &
      & new_unittest('velocities in relaxation', test_velocities), &
      & new_unittest('large strains', test_strains), &
      & new_unittest('large strains of bodies that yield', test_yielding)]
  end subroutine collect_warnings

  !> Hold a scene to having (or not having) a warning, or a note, with this text, told once.
  subroutine expect_told(error, scene, text, told, what, note)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    character(*), intent(in) :: text       !! part of the warning
    logical, intent(in) :: told            !! it must be there
    character(*), intent(in) :: what       !! the scene, for messages
    logical, intent(in), optional :: note  !! it is a note
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    type(warnings_type) :: list
    integer :: i, n

    if (allocated(error)) return
    call prepare_run(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, what//' is refused: '//fault%message)
      return
    end if
    list = set_up%warnings
    if (present(note)) list = set_up%notes
    n = 0
    do i = 1, list%count()
      if (index(list%line(i), text) > 0) n = n + 1
    end do
    call expect_true(error, n == merge(1, 0, told), what//": '"//text//"' "//to_text(n)// &
      & ' times in: '//list%text())
  end subroutine expect_told

  !> A chain in the plane and a sheet in space are; two rows, a chain in 1D, or a sheet that another
  !> body on the same grid makes thicker are not.
  subroutine test_thin(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = 'is one point thick in '
    type(scene_type) :: scene

    call box_scene([8, 1], spacing, 0.2_wp, scene)
    call expect_told(error, scene, text//'y', .true., 'a chain in 2D')
    call expect_told(error, scene, text//'x', .false., 'a chain in 2D')
    scene%horizon%family = 'list'
    call expect_told(error, scene, text//'y', .true., 'a chain in 2D, list')
    call box_scene([6, 5, 1], spacing, 0.2_wp, scene)
    call expect_told(error, scene, text//'z', .true., 'a sheet in 3D')
    call box_scene([1, 8, 1], spacing, 0.2_wp, scene)
    call expect_told(error, scene, text//'z', .true., 'a chain in 3D')
    call expect_told(error, scene, text//'x', .true., 'a chain in 3D')
    call box_scene([8], spacing, 0.2_wp, scene)
    call expect_told(error, scene, text, .false., 'a bar in 1D')
    call box_scene([8, 2], spacing, 0.2_wp, scene)
    call expect_told(error, scene, text, .false., 'two rows in 2D')
    call box_scene([8, 1], spacing, 0.2_wp, scene)
    scene%bodies = [scene%bodies(1), scene%bodies(1)]
    scene%bodies(2)%name = 'upper'
    scene%bodies(2)%lower(2) = spacing
    scene%bodies(2)%upper(2) = 2*spacing
    call expect_told(error, scene, text, .false., 'two chains side by side')
  end subroutine test_thin

  !> Lattices are thin along their own axes; sheets of a cloud may lie across all axes, or be bent:
  !> here around a cylinder with a radius of 10 spacings. Two sheets are not thin.
  subroutine test_thin_anywhere(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: turned = ' axis_1=0.8,0.6 / &material youngs_modulus=1e9 '// &
      & "poissons_ratio=.25 / &time method='relaxation' /"
    character(*), parameter :: strip = '&scene dimension=2 / &body lower=0,0 '
    character(*), parameter :: of_cloud = "&scene dimension=3 / &body file='"//here// &
      & "/cloud.txt' / &material youngs_modulus=1e9 poissons_ratio=.25 / "// &
      & "&time method='relaxation' / &horizon length=3.015 /"
    character(*), parameter :: text = 'body 1 is one point thick'
    integer :: layers

    call expect_told_of(error, strip//'upper=1,.05 points=20,1'//turned, &
      & text//' along its axis 2', .true., 'a turned chain')
    call expect_told_of(error, strip//'upper=.05,1 points=1,20'//turned, &
      & text//' along its axis 1', .true., 'a turned chain across')
    call expect_told_of(error, strip//'upper=1,.1 points=20,2'//turned, text, .false., &
      & 'two turned rows')
    do layers = 1, 2
      call sheets(layers, 0.0_wp, error)
      call expect_told_of(error, of_cloud, text//': ', layers == 1, 'plane sheets')
      call sheets(layers, 0.1_wp, error)
      call expect_told_of(error, of_cloud, text//': ', layers == 1, 'bent sheets')
    end do
  end subroutine test_thin_anywhere

  !> A cloud of 15 x 12 points in sheets 1 m apart from each other, oblique to all axes or, with a
  !> curvature [1/m], around the x-axis.
  subroutine sheets(layers, curvature, error)
    integer, intent(in) :: layers
    real(wp), intent(in) :: curvature
    type(error_type), allocatable, intent(inout) :: error
    real(wp), parameter :: along(3) = [1.0_wp, 2.0_wp, 2.0_wp]/3
    real(wp), parameter :: across(3) = [2.0_wp, 1.0_wp, -2.0_wp]/3
    real(wp), parameter :: normal(3) = [-2.0_wp, 2.0_wp, -1.0_wp]/3
    type(sink_type) :: sink
    type(fault_type), allocatable :: fault
    real(wp) :: x(3), radius
    integer :: i, j, k

    if (allocated(error)) return
    call make_directory(here, fault)
    if (.not. allocated(fault)) call sink%open(here//'/cloud.txt', fault)
    do k = 1, layers
      do j = 1, 15
        do i = 1, 12
          x = i*along + j*across + k*normal
          if (curvature > 0.0_wp) then
            radius = 1/curvature + k
            x = [real(i, wp), radius*cos(j*curvature), radius*sin(j*curvature)]
          end if
          if (.not. allocated(fault)) call sink%put(to_text(x(1))//' '//to_text(x(2))//' '// &
            & to_text(x(3))//' 1'//new_line('a'), fault)
        end do
      end do
    end do
    if (.not. allocated(fault)) call sink%close(fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine sheets

  !> Two triangles that make a square of 6 x 6 m in a cube of 6 x 6 x 6 points, through a row of
  !> them, between rows, and through a part of a row.
  subroutine test_crack_surfaces(error)
    type(error_type), allocatable, intent(out) :: error

    call told(3.5_wp, 6.0_wp, ' 36 points', .true., 'through a row')
    call told(3.5_wp, 3.0_wp, ' 18 points', .true., 'through half of a row')
    call told(3.0_wp, 6.0_wp, '', .false., 'between rows')

  contains

    !> Hold the square from x = 0 to `width` at a height to cutting so many points.
    subroutine told(height, width, points, is_told, what)
      real(wp), intent(in) :: height, width
      character(*), intent(in) :: points, what
      logical, intent(in) :: is_told
      real(wp) :: x(3, 3, 2)
      type(fault_type), allocatable :: fault
      type(sink_type) :: sink

      if (allocated(error)) return
      x(3, :, :) = height
      x(:2, 1, 1) = [0.0_wp, 0.0_wp]
      x(:2, 2, 1) = [width, 0.0_wp]
      x(:2, 3, 1) = [width, 6.0_wp]
      x(:2, :, 2) = x(:2, [1, 3, 2], 1)
      x(:2, 3, 2) = [0.0_wp, 6.0_wp]
      x(:2, 2, 2) = [width, 6.0_wp]
      call make_directory(here, fault)
      if (.not. allocated(fault)) call sink%open(here//'/square.stl', fault)
      if (.not. allocated(fault)) call sink%put(ascii_stl(x, 'square'), fault)
      if (.not. allocated(fault)) call sink%close(fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call expect_told_of(error, '&scene dimension=3 / &body lower=0,0,0 upper=6,6,6 '// &
        & "points=6,6,6 / &material youngs_modulus=1e9 poissons_ratio=.25 / "// &
      & "&time method='relaxation' / "// &
        & "&crack surface='"//here//"/square.stl' scale=1 /", 'runs through'//points, is_told, what)
    end subroutine told
  end subroutine test_crack_surfaces

  !> Points lie at half-integer multiples of the spacing. Cracks between rows, or whose line runs
  !> through points beyond their tip, cut none in two.
  subroutine test_cracks(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%from(:2) = [0.0_wp, 3.5_wp]*spacing
    scene%cracks(1)%to(:2) = [4.0_wp, 3.5_wp]*spacing
    call expect_told(error, scene, 'runs through 4 points', .true., 'a crack along a row')
    call expect_told(error, scene, 'spacing (5 mm)', .true., 'a crack along a row')
    scene%cracks(1)%from(2) = 4.0_wp*spacing
    scene%cracks(1)%to(2) = 4.0_wp*spacing
    call expect_told(error, scene, 'runs through', .false., 'a crack between rows')
    scene%cracks(1)%from(:2) = [-4.0_wp, 3.5_wp]*spacing
    scene%cracks(1)%to(:2) = [0.4_wp, 3.5_wp]*spacing
    call expect_told(error, scene, 'runs through', .false., 'a crack that ends before the points')
    call box_scene([6, 6, 6], spacing, 0.2_wp, scene)
    deallocate (scene%cracks)
    allocate (scene%cracks(1))
    scene%cracks(1)%centre = [3.0_wp, 3.0_wp, 3.5_wp]*spacing
    scene%cracks(1)%normal = [0.0_wp, 0.0_wp, 1.0_wp]
    scene%cracks(1)%radius = 1.0_wp*spacing
    call expect_told(error, scene, 'runs through 4 points', .true., 'a disc through points')
    scene%cracks(1)%centre(3) = 3.0_wp*spacing
    call expect_told(error, scene, 'runs through', .false., 'a disc between points')
  end subroutine test_cracks

  !> A cloud of 12 x 12 points in a square array, each moved a little, whose volumes are so many
  !> times those that fit.
  subroutine cloud(factor, scene, error)
    real(wp), intent(in) :: factor
    type(scene_type), intent(out) :: scene
    type(error_type), allocatable, intent(inout) :: error
    type(sink_type) :: sink
    type(fault_type), allocatable :: fault
    integer :: i, j

    call box_scene([2, 2], spacing, 0.2_wp, scene)
    scene%bodies(1)%file = here//'/cloud.txt'
    if (allocated(error)) return
    call make_directory(here, fault)
    if (.not. allocated(fault)) call sink%open(here//'/cloud.txt', fault)
    do j = 1, 12
      do i = 1, 12
        if (.not. allocated(fault)) call sink%put(to_text((i + 0.1_wp*sin(7.0_wp*j))*spacing)// &
          & ' '//to_text((j + 0.1_wp*sin(5.0_wp*i))*spacing)//' 0 '// &
          & to_text(factor*spacing**2*scene%header%thickness)//new_line('a'), fault)
      end do
    end do
    if (.not. allocated(fault)) call sink%close(fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine cloud

  !> Volumes twice too small leave each point's nearest one 1.4 roots of a volume away; volumes
  !> three times too large sum up to three times the horizon's. 30 % off may be how a cloud was
  !> made.
  subroutine test_volumes(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: right(3) = [0.75_wp, 1.0_wp, 1.3_wp]
    type(scene_type) :: scene
    integer :: i

    call cloud(0.5_wp, scene, error)
    call expect_told(error, scene, 'volumes are too small', .true., 'half the volume')
    call cloud(2.0_wp, scene, error)
    call expect_told(error, scene, 'volumes are too large', .true., 'twice the volume')
    call cloud(3.0_wp, scene, error)
    call expect_told(error, scene, 'volumes are too large', .true., 'three times the volume')
    do i = 1, 3
      call cloud(right(i), scene, error)
      call expect_told(error, scene, 'the volumes are', .false., to_text(right(i))//' volumes')
    end do
    call box_scene([12, 12], spacing, 0.2_wp, scene)
    scene%horizon%ratio = 1.0_wp
    scene%horizon%family = 'list'
    call expect_told(error, scene, 'the volumes are', .false., 'a lattice')
  end subroutine test_volumes

  subroutine test_horizons(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = 'no shear stiffness'
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    scene%horizon%ratio = 1.4_wp
    call expect_told(error, scene, text, .true., 'ratio 1.4')
    scene%horizon%ratio = sqrt(2.0_wp)
    call expect_told(error, scene, text, .false., 'ratio root 2')
    call box_scene([5, 5, 5], spacing, 0.2_wp, scene)
    scene%horizon%ratio = 1.0_wp
    call expect_told(error, scene, text, .true., 'ratio 1 in 3D')
    scene%horizon%ratio = 1.5_wp
    call expect_told(error, scene, text, .false., 'ratio 1.5 in 3D')
    call box_scene([8], spacing, 0.2_wp, scene)
    scene%horizon%ratio = 1.0_wp
    call expect_told(error, scene, text, .false., 'ratio 1 in 1D')
  end subroutine test_horizons

  !> 210,000 is steel in MPa, beside a plate 80 (mm) long.
  subroutine test_stiffness(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = "Young's modulus of "
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    call expect_told(error, scene, 'SI units', .false., 'steel')
    scene%materials(1)%youngs_modulus = 200.0_wp
    call expect_told(error, scene, text//'200 Pa', .true., 'steel in GPa')
    scene%materials(1)%youngs_modulus = 2.0e14_wp
    call expect_told(error, scene, text, .true., 'too stiff')
    scene%materials(1)%youngs_modulus = 2.1e5_wp
    call expect_told(error, scene, text, .false., 'a small piece of jelly')
    call box_scene([8, 8], 10.0_wp, 0.2_wp, scene)
    call expect_told(error, scene, text, .false., 'a large piece of steel')
    scene%materials(1)%youngs_modulus = 2.1e5_wp
    call expect_told(error, scene, 'as if they were in MPa and mm', .true., 'mm, N, MPa')
  end subroutine test_stiffness

  !> 7.85 g/cm3 and 7.85e-9 t/mm3 are steel. Statics has no density.
  subroutine test_density(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: wrong(3) = [7.85_wp, 7.85e-9_wp, 7.85e6_wp]
    type(scene_type) :: scene
    integer :: i

    do i = 1, 3
      call box_scene([8, 8], spacing, 0.2_wp, scene)
      scene%materials(1)%density = wrong(i)
      call expect_told(error, scene, 'has a density of', .true., to_text(wrong(i)))
      scene%time%method = 'relaxation'
      call expect_told(error, scene, 'has a density of', .false., to_text(wrong(i))//', statics')
    end do
    call box_scene([8, 8], spacing, 0.2_wp, scene)
    call expect_told(error, scene, 'has a density of', .false., 'steel')
  end subroutine test_density

  !> A plate 8 cm square and 2 mm thick, E = 2e11 Pa: 2e11 Pa, 3.2e7 N and 2.5e12 N/m3 strain it
  !> by 1.
  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = -1.9e11_wp
    call expect_told(error, scene, 'predicts a strain', .false., 'a large pressure')
    scene%loads(1)%pressure = -2.1e11_wp
    call expect_told(error, scene, 'its pressure predicts a strain of 1.1', .true., &
      & 'a pressure beyond E')
    scene%loads(1)%pressure = -2.1e10_wp
    scene%loads(1)%times = [0.0_wp, 1.0_wp]
    scene%loads(1)%values = [0.0_wp, 10.0_wp]
    call expect_told(error, scene, 'its pressure predicts', .true., 'a pressure times a factor')
    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%force(1) = 3.1e7_wp
    call expect_told(error, scene, 'predicts a strain', .false., 'a large force')
    scene%loads(1)%force(1) = 3.4e7_wp
    call expect_told(error, scene, 'its force predicts a strain', .true., 'a force beyond E A')
    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%loads)
    allocate (scene%loads(1))
    scene%loads(1)%body_force(2) = 2.4e12_wp
    call expect_told(error, scene, 'predicts a strain', .false., 'a large body force')
    scene%loads(1)%body_force(2) = 2.6e12_wp
    call expect_told(error, scene, 'its body_force predicts a strain', .true., &
      & 'a body force beyond E/L')
  end subroutine test_loads

  !> The plate is 8 cm long, and its bar waves run at sqrt(E/rho) = 5048 m/s.
  subroutine test_motions(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'x_max'
    scene%boundaries(1)%velocity(1) = 5000.0_wp
    call expect_told(error, scene, 'predicts a strain', .false., 'a fast boundary')
    scene%boundaries(1)%velocity(1) = 5600.0_wp
    call expect_told(error, scene, 'its velocity predicts a strain', .true., 'faster than waves')
    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%boundaries)
    allocate (scene%boundaries(1))
    scene%boundaries(1)%side = 'x_max'
    scene%boundaries(1)%ramp_time = 1.0_wp
    scene%boundaries(1)%displacement(1) = 0.07_wp
    call expect_told(error, scene, 'predicts a strain', .false., 'a large displacement')
    scene%boundaries(1)%displacement(1) = 0.1_wp
    call expect_told(error, scene, 'predicts a strain', .false., &
      & 'a slow displacement of a body that nothing else holds')
    scene%boundaries = [scene%boundaries(1), scene%boundaries(1)]
    scene%boundaries(2)%side = 'x_min'
    scene%boundaries(2)%displacement(1) = 0.0_wp
    call expect_told(error, scene, '&boundary number 1: its displacement predicts a strain of '// &
      & '1.2', .true., 'a displacement beyond the length')
    scene%boundaries(2)%displacement(1) = 0.1_wp
    call expect_told(error, scene, 'predicts a strain', .false., 'supports that move alike')
    scene%boundaries = scene%boundaries(1:1)
    scene%boundaries(1)%ramp_time = 0.0_wp
    call expect_told(error, scene, 'its displacement predicts a strain of 1.2', .true., &
      & 'a displacement at once')
  end subroutine test_motions

  !> The plate is 1 m long, its material's waves run at 1000 m/s.
  subroutine test_expressions(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plate = '&scene dimension=2 / &body lower=0,0 upper=1,.4 '// &
      & 'points=20,8 / &material youngs_modulus=1e9 poissons_ratio=.25 density=1000 / '
    character(*), parameter :: relax = "&time method='relaxation' / "
    character(*), parameter :: steps = '&time steps=1 / '
    character(*), parameter :: fixed = "&boundary side='x_min' displacement_x=0 displacement_y=0 / "
    character(*), parameter :: held = "&boundary region='r' displacement_x="
    character(*), parameter :: ends = "&region name='r' where='(x<.1)+(x>.9)' / "// &
      & "&region name='b' where='x<.9' / &crack from=.5,-1 to=.5,2 / "
    character(*), parameter :: text = ' predicts a strain of '

    call expect_told_of(error, plate//relax//ends//held//"'2*x' /", text, .false., &
      & 'parted by a crack, both stretched by less')
    call expect_told_of(error, plate//relax//"&region name='r' where='(x<.1)+(x>.9)' / "//held// &
      & "'2*x' /", 'its displacement'//text, .true., 'a stretch by 2')
    call expect_told_of(error, plate//relax//"&region name='r' where='(x<.1)+(x>.9)' / "//held// &
      & "'0.9*x' /", text, .false., 'a stretch by 0.9')
    call expect_told_of(error, plate//relax//"&region name='r' where='(x<.1)+(x>.9)' / "//held// &
      & "'7*t-2*x*sin(pi*t/2)^2' displacement_y='-2*y*sin(pi*t/2)^2' /", text, .false., &
      & 'half a turn')
    call expect_told_of(error, plate//relax//fixed//"&boundary side='x_max' displacement_x=-2 "// &
      & 'displacement_y=0 /', 'its displacement'//text//'2;', .true., 'ends that change places')
    call expect_told_of(error, plate//relax//fixed//"&load side='x_max' pressure='-9e8*t' /", &
      & text, .false., 'a pressure as an expression')
    call expect_told_of(error, plate//relax//fixed//"&load side='x_max' pressure='-2e9*t' /", &
      & 'its pressure'//text, .true., 'a pressure beyond E as an expression')
    call expect_told_of(error, plate//relax//fixed//"&load side='x_max' force_y='4e9/2' /", &
      & 'its force'//text, .true., 'a force as an expression')
    call expect_told_of(error, plate//relax//fixed//"&region name='r' where='x>0' / "// &
      & "&load region='r' body_force_y='1e10*x' /", 'its body_force'//text, .true., &
      & 'a body force as an expression')
    call expect_told_of(error, '&scene gravity=0,-1e6 '//plate(7:)//relax//fixed, text, .false., &
      & 'a strong gravity')
    call expect_told_of(error, '&scene gravity=0,-9.81e9 '//plate(7:)//relax//fixed, &
      & '&scene: its gravity'//text, .true., 'gravity in other units')
    call expect_told_of(error, plate//steps//"&boundary side='x_max' velocity_x='990*cos(y)' /", &
      & text, .false., 'a fast boundary')
    call expect_told_of(error, plate//steps//"&boundary side='x_max' velocity_x='1200*cos(y)' /", &
      & 'its velocity'//text, .true., 'a boundary faster than waves')
    call expect_told_of(error, plate//steps//"&boundary side='x_max' velocity_x=1200 / "// &
      & '&initial velocity_x=1200 /', text, .false., 'a body that is as fast')
  end subroutine test_expressions

  !> Ten steps of 1e-7 s.
  subroutine test_schedule(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: beyond = 'only the first and the final state are written'
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    scene%time%step = 1.0e-7_wp
    scene%time%steps = 10
    scene%output%interval = 1.1e-6_wp
    call expect_told(error, scene, beyond, .true., 'an interval beyond the end')
    scene%output%interval = 1.0e-6_wp
    call expect_told(error, scene, beyond, .false., 'an interval to the end')
    call box_scene([8, 8], spacing, 0.2_wp, scene)
    scene%time%steps = 10
    scene%output%every = 11
    call expect_told(error, scene, beyond, .true., 'every 11th of 10 steps')
    scene%output%every = 10
    call expect_told(error, scene, beyond, .false., 'every 10th of 10 steps')
    scene%output%history_every = 10
    call expect_told(error, scene, 'history_every', .false., 'a row every 10th of 10 steps')
    scene%output%history_every = 11
    call expect_told(error, scene, 'history_every = 11 is more', .true., &
      & 'a row every 11th of 10 steps')
    scene%time%method = 'relaxation'
    scene%output%every = 1
    call expect_told(error, scene, 'history_every', .false., 'iterations of a relaxation')
    scene%output%every = 2
    call expect_told(error, scene, beyond, .true., 'every second of one load step')
  end subroutine test_schedule

  subroutine test_empty(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%regions, scene%no_fail)
    allocate (scene%regions(1), scene%no_fail(1))
    scene%regions(1)%name = 'left'
    scene%regions(1)%shape = 'box'
    scene%no_fail(1)%shape = 'box'
    scene%materials(1)%critical_stretch = 1.0_wp
    call expect_told(error, scene, 'holds no point', .false., 'boxes without limits')
    scene%no_fail(1)%upper(1) = -1.0_wp
    call expect_told(error, scene, '&no_fail number 1 holds no point', .true., 'an empty zone')
    scene%no_fail(1)%upper(1) = 1.0_wp
    scene%regions(1)%upper(1) = -1.0_wp
    call expect_told(error, scene, 'the region left holds no point', .true., 'an empty region')
    ! a second body that is to fill a hole, which the hole takes away as well
    call box_scene([8, 8], spacing, 0.2_wp, scene)
    scene%bodies = [scene%bodies, scene%bodies]
    deallocate (scene%removed)
    allocate (scene%removed(1))
    scene%removed(1)%shape = 'box'
    scene%removed(1)%lower(:2) = 2*spacing
    scene%removed(1)%upper(:2) = 5*spacing
    scene%bodies(2)%lower(:2) = 2*spacing
    scene%bodies(2)%upper(:2) = 4*spacing
    scene%bodies(2)%points(:2) = 2
    call expect_told(error, scene, '&body number 2 holds no point', .true., 'a body removed')
    call expect_told(error, scene, '&body number 1 holds no point', .false., 'a body with a hole')
    scene%removed(1)%lower(:2) = 3*spacing
    scene%bodies(1)%lower(:2) = 4*spacing
    scene%bodies(1)%upper(:2) = 12*spacing
    call expect_told(error, scene, '&body number 2 holds no point', .false., 'a body cut')
  end subroutine test_empty

  subroutine test_clamps(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    call box_scene([8, 8], spacing, 0.2_wp, scene)
    deallocate (scene%regions, scene%boundaries)
    allocate (scene%regions(1), scene%boundaries(1))
    scene%regions(1)%name = 'left'
    scene%regions(1)%shape = 'box'
    scene%regions(1)%upper(1) = 2*spacing
    scene%boundaries(1)%region = 'left'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    call expect_told(error, scene, 'cannot rotate', .false., 'one component', note=.true.)
    scene%boundaries(1)%velocity(2) = 0.0_wp
    call expect_told(error, scene, 'cannot rotate', .true., 'all components', note=.true.)
    scene%regions(1)%upper(:2) = spacing
    call expect_told(error, scene, 'cannot rotate', .false., 'a single point', note=.true.)
  end subroutine test_clamps

  !> What two groups hold together is a clamp, too; points on one line in 3D turn about it.
  subroutine test_common_clamps(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plate = '&scene dimension=2 / &body lower=0,0 upper=1,.4 '// &
      & "points=20,8 / &material youngs_modulus=1e9 poissons_ratio=.25 / "// &
      & "&region name='r' where='x>.85' / "// &
      & "&region name='p' where='(x>.95)*(y>.35)' / &region name='q' where='(x<.05)*(y<.05)' / "// &
      & "&time method='relaxation' / &load side='x_min' force_y=1 / &boundary displacement_x=0 "
    character(*), parameter :: block = '&scene dimension=3 / &body lower=0,0,0 upper=1,.4,.4 '// &
      & "points=10,4,4 / &material youngs_modulus=1e9 poissons_ratio=.25 / "// &
      & "&time method='relaxation' / "// &
      & "&load side='x_max' force_y=1 / &boundary region='r' displacement_x=0 "// &
      & 'displacement_y=0 displacement_z=0 / &region '
    character(*), parameter :: text = 'it cannot rotate there, as in a clamp'

    call expect_told_of(error, plate//"region='r' / &boundary region='r' displacement_y=0 /", &
      & '&boundary number 1 and number 2 together hold all components of 24 points: '//text, &
      & .true., 'two groups', note=.true.)
    call expect_told_of(error, plate//"region='r' / &boundary region='p' displacement_y=0 /", &
      & text, .false., 'two groups with one common point', note=.true.)
    call expect_told_of(error, plate//"region='r' / &boundary region='q' displacement_y=0 /", &
      & text, .false., 'two groups apart', note=.true.)
    call expect_told_of(error, block//"name='r' where='(x<.1)*(y<.1)' /", text, .false., &
      & 'a line of points', note=.true.)
    call expect_told_of(error, block//"name='r' where='(x<.1)*(y<.1)*(z<.1)' /", text, .false., &
      & 'a single point', note=.true.)
    call expect_told_of(error, block//"name='r' where='(x<.1)*(y<.2)' /", text, .true., &
      & 'two lines of points', note=.true.)
  end subroutine test_common_clamps

  !> The same of the scene of a text.
  subroutine expect_told_of(error, scene_text, text, told, what, note)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: scene_text
    character(*), intent(in) :: text       !! part of the warning
    logical, intent(in) :: told            !! it must be there
    character(*), intent(in) :: what       !! the scene, for messages
    logical, intent(in), optional :: note  !! it is a note
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call read_scene_text(scene_text, '', scene, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_told(error, scene, text, told, what, note)
  end subroutine expect_told_of

  !> 1 kN along x at the end of a plate 1 m long and 0.4 m high. Held at the lower left point, at
  !> (0.025, 0.025), it turns about that: 175 N m. On rollers along x it moves; at its middle a pin
  !> leaves no moment. A block 0.4 m high turns about an edge that is held.
  subroutine test_driven(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plate = '&scene dimension=2 / &body lower=0,0 upper=1,.4 '// &
      & "points=20,8 / &material youngs_modulus=1e9 poissons_ratio=.25 / "// &
      & "&time method='relaxation' / "// &
      & "&load side='x_max' force_x=1e3 / "
    character(*), parameter :: block = '&scene dimension=3 / &body lower=0,0,0 upper=1,.4,.4 '// &
      & "points=10,4,4 / &material youngs_modulus=1e9 poissons_ratio=.25 / "// &
      & "&time method='relaxation' / "// &
      & "&load side='x_max' force_y=1 / "
    character(*), parameter :: held = "&boundary region='r' displacement_x=0 displacement_y=0 "

    call driven(plate//"&region name='r' where='(x<.05)*(y<.05)' / "//held//'/', &
      & '(net moment 175 N m about (0.025, 0.025), net over applied')
    call driven(plate, '(net force 1000 N, net moment')
    call driven(plate//"&boundary side='y_min' displacement_y=0 /", &
      & '(net force 1000 N along (1, 0), net over applied')
    call driven(block//"&region name='r' where='(x<.1)*(y<.1)' / "//held//'displacement_z=0 /', &
      & '(net moment 0.9 N m about the axis through (0.05, 0.05, 0.2) along (0, 0, 1), net over')

  contains

    !> A run must fail with this in its message.
    subroutine driven(scene_text, part)
      character(*), intent(in) :: scene_text, part
      type(scene_type) :: scene
      type(run_options_type) :: options
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call read_scene_text(scene_text, '', scene, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      options%output_directory = here//'/driven'
      options%quiet = .true.
      options%overwrite = .true.
      call run_scene(scene, options, fault)
      if (.not. allocated(fault)) then
        call test_failed(error, 'an equilibrium was found')
        return
      end if
      call expect_true(error, index(fault%message, part) > 0, part//' is not in: '//fault%message)
    end subroutine driven
  end subroutine test_driven

  !> A gap of 0.01 J in 2 J is compared with 0.1 J that are dissipated, not with 1e-9 J.
  subroutine test_dissipated(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(system_type) :: system
    real(wp) :: off, share, of_dissipated

    balance%energies%kinetic = 1.0_wp
    balance%energies%strain = 0.89_wp
    balance%supply = 2.0_wp
    system%dissipated = 0.1_wp
    call balance%gap(system, off, share, of_dissipated)
    call expect(error, off, -0.01_wp, 1.0e-12_wp, 'gap')
    call expect(error, share, 0.005_wp, 1.0e-12_wp, 'share')
    call expect(error, of_dissipated, 0.1_wp, 1.0e-12_wp, 'of what is dissipated')
    balance%energies%strain = 0.99_wp
    system%dissipated = 1.0e-9_wp
    call balance%gap(system, off, share, of_dissipated)
    call expect(error, off, -0.01_wp, 1.0e-8_wp, 'gap beside next to no dissipation')
    call expect(error, of_dissipated, -1.0_wp, 0.0_wp, 'next to nothing is dissipated')
  end subroutine test_dissipated

  !> Two plates of different materials, parted by a crack; only the first one, or a part of it, is
  !> heated.
  subroutine test_idle_heat(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plates = '&scene dimension=2 / '// &
      & "&body lower=0,0 upper=.5,.4 points=10,8 material='A' / "// &
      & "&body lower=.5,0 upper=1,.4 points=10,8 material='B' / &crack from=.5,-1 to=.5,1 / "// &
      & "&region name='q' where='x<.3' / &region name='r' where='x>.8' / "// &
      & "&time method='relaxation' / "
    character(*), parameter :: a = "&material name='A' youngs_modulus=1e9 poissons_ratio=.25 "
    character(*), parameter :: b = "&material name='B' youngs_modulus=1e9 poissons_ratio=.25 "
    character(*), parameter :: alone = '&scene dimension=2 / &body lower=0,0 upper=.2,.2 '// &
      & "points=4,4 / &time method='relaxation' / &material youngs_modulus=1e9 poissons_ratio=.25 "
    character(*), parameter :: text = 'has no thermal_expansion'
    character(*), parameter :: expands = ' thermal_expansion=1e-5 / '
    character(*), parameter :: warm = "&initial region='q' temperature_change=10 /"
    character(*), parameter :: from_file = "/ &initial file='"//here//"/heat.txt' /"
    type(sink_type) :: sink
    type(fault_type), allocatable :: fault
    integer :: i

    call expect_told_of(error, plates//a//expands//b//'/ '//warm, text, .false., 'A is heated')
    call expect_told_of(error, plates//a//'/ '//b//expands//warm, "material 'A' "//text, .true., &
      & 'A does not expand')
    call expect_told_of(error, plates//a//expands//b// &
      & "/ &initial region='r' temperature_change='10*x*t' /", "material 'B' "//text, .true., &
      & 'B is heated by an expression')
    call expect_told_of(error, plates//a//'/ '//b//"/ &initial temperature_change='0*x' /", text, &
      & .false., 'no change')
    call expect_told_of(error, alone//'/ &initial temperature_change=10 /', &
      & 'material number 1 '//text, .true., 'without a name')
    call expect_told_of(error, alone//'thermal_expansion=0 / &initial temperature_change=10 /', &
      & text, .false., 'an expansion of 0 is given')
    do i = 0, 1
      if (allocated(error)) return
      call make_directory(here, fault)
      if (.not. allocated(fault)) call sink%open(here//'/heat.txt', fault)
      if (.not. allocated(fault)) call sink%put('temperature_change'//new_line('a')// &
        & repeat(to_text(5*i)//new_line('a'), 16), fault)
      if (.not. allocated(fault)) call sink%close(fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call expect_told_of(error, alone//from_file, text, i == 1, 'a file with '//to_text(5*i))
      call expect_told_of(error, alone//'thermal_expansion=1e-5 '//from_file, text, .false., &
        & 'a file, expanding')
    end do
  end subroutine test_idle_heat

  !> Velocities of boundaries as numbers, which grow over the load steps, and as expressions of t
  !> and y: 1e-4 m/s goes 0.05 mm then, 3e-4 t**2 m/s 0.1 mm.
  subroutine test_velocities(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: plate = '&scene dimension=2 / &body lower=0,0 upper=1,.4 '// &
      & 'points=20,8 / &material youngs_modulus=1e9 poissons_ratio=.25 density=1000 / '// &
      & "&boundary side='x_min' displacement_x=0 displacement_y=0 / "
    character(*), parameter :: relax = "&time method='relaxation' / "
    character(*), parameter :: pulled = "&boundary side='x_max' "
    character(*), parameter :: text = 'velocity_x of &boundary number 2 displaces its points by '

    call expect_told_of(error, plate//relax//pulled//'velocity_x=1e-4 /', text//'50 um', .true., &
      & 'a number')
    call expect_told_of(error, plate//relax//pulled//"velocity_x='3e-4*t**2' /", text//'100 um', &
      & .true., 'an expression of t')
    call expect_told_of(error, plate//relax//pulled//"velocity_x='1e-4*(1-y)' /", text//'up to ', &
      & .true., 'an expression of y')
    call expect_told_of(error, plate//relax//pulled//"velocity_x='2*0' /", text, .false., 'zero')
    call expect_told_of(error, plate//relax//pulled//"displacement_x='1e-4*t' /", text, .false., &
      & 'a displacement')
    call expect_told_of(error, plate//'&time steps=1 / '//pulled//"velocity_x='1e-4*t' /", text, &
      & .false., 'in time')
  end subroutine test_velocities

  !> A uniform strain along x of 11 % is told by the run, 9 % and a turn by 90 degrees are not; in
  !> every dimension.
  subroutine test_strains(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: dim, i
    type(scene_type) :: scene
    type(run_options_type) :: options
    character(:), allocatable :: text
    real(wp), parameter :: strain(4) = [0.11_wp, -0.11_wp, 0.09_wp, 0.0_wp]

    options%output_directory = here//'/strain'
    options%quiet = .true.
    options%overwrite = .true.
    do dim = 1, 3
      do i = 1, size(strain)
        if (i == 4 .and. dim == 1) cycle
        call box_scene(spread(5, 1, dim), spacing, 0.2_wp, scene)
        deallocate (scene%initial)
        allocate (scene%initial(1))
        scene%initial(1)%displacement_gradient(1, 1) = strain(i)
        ! a turn is u_x = -x - y, u_y = x - y
        if (i == 4) scene%initial(1)%displacement_gradient(:2, :2) = &
          & reshape([-1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp], [2, 2])
        call run_for_warnings(scene, options, text, error)
        if (allocated(error)) return
        call expect_true(error, (index(text, 'strained by more than 10 %') > 0) .eqv. i <= 2, &
          & to_text(dim)//'D, case '//to_text(i)//': '//text)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_strains

  !> Bodies that yield are stretched and compressed along x at their volume; the bonds along x have
  !> the strain of the body, those across half of it, and all others less. `lps_plastic` is warned
  !> of beyond 10 %, though flow leaves it hardly any energy; `lps_plastic_large` beyond a
  !> logarithmic strain of 0.4, in compression where it is -0.42 with a stretch of only -0.34.
  subroutine test_yielding(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: strain(4) = [0.42_wp, 0.38_wp, -0.42_wp, -0.38_wp]
    type(scene_type) :: scene
    type(run_options_type) :: options
    character(:), allocatable :: text
    integer :: law, i, c

    options%output_directory = here//'/yielding'
    options%quiet = .true.
    options%overwrite = .true.
    do law = 1, 2
      do i = 1, size(strain)
        call box_scene(spread(5, 1, 3), spacing, 0.3_wp, scene)
        scene%materials(1)%model = trim(merge('lps_plastic_large', 'lps_plastic      ', law == 2))
        scene%materials(1)%influence = 'linear'
        allocate (scene%materials(1)%parameters(2))
        scene%materials(1)%parameters%name = ['yield_stress', 'hardening   ']
        scene%materials(1)%parameters%value = [1.0e7_wp, 0.0_wp]
        deallocate (scene%initial)
        allocate (scene%initial(1))
        do c = 1, 3
          scene%initial(1)%displacement_gradient(c, c) = exp(merge(1.0_wp, -0.5_wp, c == 1) &
            & *strain(i)) - 1
        end do
        call run_for_warnings(scene, options, text, error)
        if (allocated(error)) return
        call expect_true(error, (index(text, 'strained by more than 10 %') > 0) .eqv. law == 1, &
          & 'small strains, case '//to_text(i)//': '//text)
        call expect_true(error, (index(text, 'logarithmic strains beyond 0.4,') > 0) .eqv. &
          & (law == 2 .and. mod(i, 2) == 1), 'large strains, case '//to_text(i)//': '//text)
        if (allocated(error)) return
      end do
    end do
  end subroutine test_yielding

  !> Run a scene and get the text of its warnings; '' without any.
  subroutine run_for_warnings(scene, options, text, error)
    type(scene_type), intent(inout) :: scene
    type(run_options_type), intent(in) :: options  !! with the folder of the results
    character(:), allocatable, intent(out) :: text
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    text = ''
    call run_scene(scene, options, fault)
    if (.not. allocated(fault) .and. file_exists(options%output_directory//'/warnings.txt')) &
      & call read_text_file(options%output_directory//'/warnings.txt', text, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine run_for_warnings

end module test_warnings
