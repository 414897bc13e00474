!> Build a scene in memory: a free plate that is heated by 100 K. Every distance grows by alpha dT,
!> and nothing is strained beyond that.
program in_memory
  use perifort, only: answer_type, error_type, preview_scene, run_options_type, run_scene, &
    & scene_type, wp
  implicit none (type, external)
  real(wp), parameter :: alpha = 1.2e-5_wp, heating = 100.0_wp
  type(scene_type) :: scene
  type(run_options_type) :: options
  type(answer_type) :: answer
  type(error_type), allocatable :: error
  real(wp), allocatable :: u(:, :)
  character(:), allocatable :: text
  real(wp) :: growth

  ! only what differs from the defaults; lists that are not needed stay unallocated
  scene%header%dimension = 2
  allocate (scene%bodies(1), scene%materials(1), scene%initial(1))
  scene%bodies(1)%lower(:2) = [0.0_wp, 0.0_wp]
  scene%bodies(1)%upper(:2) = [0.2_wp, 0.1_wp]
  scene%bodies(1)%points(:2) = [40, 20]
  scene%materials(1)%youngs_modulus = 200.0e9_wp
  scene%materials(1)%poissons_ratio = 0.3_wp
  scene%materials(1)%thermal_expansion = alpha
  scene%initial(1)%temperature_change = heating
  scene%time%method = 'relaxation'
  scene%output%fields = [character(64) :: 'displacement', 'energy_density']

  ! what a run would do, as a text
  options%quiet = .true.
  call preview_scene(scene, options, error, text)
  if (.not. allocated(error)) print '(a)', text

  options%files = .false.
  if (.not. allocated(error)) call run_scene(scene, options, error, answer=answer)
  if (.not. allocated(error)) call answer%get_field('displacement', u, error)
  if (allocated(error)) then
    print '(a)', error%message
    error stop
  end if

  ! points are numbered x fastest: 1 and 800 are opposite corners
  growth = (u(800, 1) - u(1, 1))/(answer%positions(800, 1) - answer%positions(1, 1))
  print '(a, es12.4, a, es12.4)', 'growth', growth, '   alpha dT', alpha*heating
  if (abs(growth/(alpha*heating) - 1) > 1.0e-4_wp) error stop 'the growth is off'
end program in_memory
