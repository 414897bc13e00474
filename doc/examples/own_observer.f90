!> An observer of one's own: wait for a wave at the far end of a bar, then stop the run.
module arrivals
  use perifort, only: displacements_of, error_type, fail, instant_type, observer_type, point_near, &
    & status_interrupted, system_type, wp
  implicit none (type, external)
  private
  public :: arrival_type

  !> Notes when a place has moved by so much.
  type, extends(observer_type) :: arrival_type
    real(wp) :: place = 0.0_wp       !! [m]
    real(wp) :: threshold = 0.0_wp   !! [m]
    real(wp) :: time = -1.0_wp       !! when it had [s]; < 0: not yet
  contains
    procedure :: observe
  end type arrival_type

contains

  !> Called at every instant, beside the recorder. An error with `status_interrupted` stops the run
  !> in order: this state is the last output.
  subroutine observe(observer, system, instant, error)
    class(arrival_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: u(:, :)

    u = displacements_of(system)
    if (u(point_near(system, [observer%place]), 1) < observer%threshold) return
    observer%time = instant%time
    call fail(error, 'the wave has arrived', status_interrupted)
  end subroutine observe

end module arrivals

program own_observer
  use arrivals, only: arrival_type
  use perifort, only: error_type, read_scene_text, run_options_type, run_scene, scene_type, &
    & status_interrupted, wp
  implicit none (type, external)
  ! pushed at 1 m/s, the bar moves at this speed from where the wave, at sqrt(E/rho), has been
  real(wp), parameter :: push = 1.0_wp, length = 1.0_wp, speed = sqrt(200.0e9_wp/7850.0_wp)
  type(scene_type) :: scene
  type(run_options_type) :: options
  type(error_type), allocatable :: error
  type(arrival_type) :: arrival
  real(wp) :: expected

  call read_scene_text("&scene dimension = 1 / &body lower = 0.0, upper = 1.0, points = 400 / "// &
    & "&material model = 'bond_based', youngs_modulus = 200.0e9, density = 7850.0 / "// &
    & "&boundary side = 'x_min', velocity_x = 1.0 / &time duration = 1.0 /", 'bar', scene, error)
  arrival%place = 0.75_wp*length
  arrival%threshold = 0.01_wp*push*length/speed
  options%files = .false.
  options%quiet = .true.
  if (.not. allocated(error)) call run_scene(scene, options, error, arrival)
  if (.not. allocated(error)) error stop 'the run came to its end'
  print '(a)', error%message
  if (error%status /= status_interrupted) error stop

  ! the front passes, and it takes 0.01 L/c more to move by the threshold
  expected = (0.75_wp + 0.01_wp)*length/speed
  print '(a, es12.4, a, es12.4)', 'arrival [s]', arrival%time, '   expected', expected
  if (abs(arrival%time/expected - 1) > 0.02_wp) error stop 'the wave is late or early'
end program own_observer
