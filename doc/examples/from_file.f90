!> Read a scene from a file, run it, and take the results from memory: a bar that is pulled.
!>
!>     ./pf examples from_file [SCENE.nml]
program from_file
  use perifort, only: answer_type, error_type, read_scene, run_options_type, run_scene, &
    & scene_type, wp
  implicit none (type, external)
  real(wp), parameter :: force = 1000.0_wp, distance = 0.5_wp
  real(wp), parameter :: strain = force/(200.0e9_wp*1.0e-3_wp)   ! F/(E A)
  type(scene_type) :: scene
  type(run_options_type) :: options
  type(answer_type) :: answer
  type(error_type), allocatable :: error
  real(wp), allocatable :: left(:), right(:), reaction(:)
  character(1000) :: path

  path = 'doc/examples/bar.nml'
  if (command_argument_count() > 0) call get_command_argument(1, path)

  ! a file with a fault gives an error that names its line
  call read_scene(trim(path), scene, error)
  call stop_at(error)

  ! nothing is written and nothing printed; without these two lines results go to out/bar
  options%files = .false.
  options%quiet = .true.
  call run_scene(scene, options, error, answer=answer)
  call stop_at(error)

  ! columns of the history have the names that history.csv has; the last row is the equilibrium
  call answer%get_column('left_displacement_x', left, error)
  call stop_at(error)
  call answer%get_column('right_displacement_x', right, error)
  call stop_at(error)
  call answer%get_column('wall_reaction_x', reaction, error)
  call stop_at(error)
  associate (last => size(left))
    print '(a, es12.4, a, es12.4)', 'strain [-]           ', (right(last) - left(last))/distance, &
      & '   F/(E A)', strain
    print '(a, es12.4, a, es12.4)', 'force of the wall [N]', reaction(last), '   -F     ', -force
    if (abs((right(last) - left(last))/distance/strain - 1) > 1.0e-3_wp) &
      & error stop 'the strain is off'
    if (abs(reaction(last)/force + 1) > 1.0e-5_wp) error stop 'the reaction is off'
  end associate

contains

  !> End the program with the message of an error, if there is one.
  subroutine stop_at(error)
    type(error_type), allocatable, intent(in) :: error
    if (.not. allocated(error)) return
    print '(a)', error%message
    error stop
  end subroutine stop_at

end program from_file
