!> One scene, several runs: a bar that is held at one end and released from a uniform strain. After
!> half a period, 2 L/c, its free end has the opposite displacement; the finer the bar, the nearer.
program sweep
  use perifort, only: answer_type, check_scene, error_type, read_scene_text, run_options_type, &
    & run_scene, scene_type, wp
  implicit none (type, external)
  integer, parameter :: points(4) = [25, 50, 100, 200]
  real(wp), parameter :: strain = 1.0e-3_wp, speed = sqrt(200.0e9_wp/7850.0_wp)
  type(scene_type) :: scene
  type(run_options_type) :: options
  type(answer_type) :: answer
  type(error_type), allocatable :: error
  real(wp), allocatable :: u(:, :)
  real(wp) :: deviation(size(points)), expected
  integer :: i

  call read_scene_text("&scene dimension = 1 / &body lower = 0.0, upper = 1.0, points = 25 / "// &
    & "&material model = 'bond_based', youngs_modulus = 200.0e9, density = 7850.0 / "// &
    & "&initial displacement_gradient(1,1) = 1.0e-3 / "// &
    & "&boundary side = 'x_min', displacement_x = 0.0 / &time duration = 1.0e-4 /", 'bar', scene, &
    & error)
  scene%time%duration = 2/speed
  options%files = .false.
  options%quiet = .true.
  do i = 1, size(points)
    if (allocated(error)) exit
    ! a scene may be changed between runs; every run completes and checks it anew, and so can you
    scene%bodies(1)%points(1) = points(i)
    call check_scene(scene, error)
    if (.not. allocated(error)) call run_scene(scene, options, error, answer=answer)
    if (.not. allocated(error)) call answer%get_field('displacement', u, error)
    if (allocated(error)) exit
    ! the last point of the body; those of the layer that holds it follow
    expected = -strain*answer%positions(points(i), 1)
    deviation(i) = abs(u(points(i), 1)/expected - 1)
    print '(i5, a, es13.5, a, es13.5, a, f7.3, a)', points(i), ' points: displacement [m]', &
      & u(points(i), 1), '   expected', expected, '   off by', 100*deviation(i), ' %'
  end do
  if (allocated(error)) then
    print '(a)', error%message
    error stop
  end if
  if (any(deviation(2:) >= deviation(:size(points) - 1))) error stop 'finer is not nearer'
  if (deviation(size(points)) > 0.02_wp) error stop 'the finest is off'
end program sweep
