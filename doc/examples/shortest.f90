program shortest
  use perifort, only: answer_type, error_type, read_scene, run_options_type, run_scene, scene_type
  implicit none (type, external)
  type(scene_type) :: scene
  type(run_options_type) :: options
  type(answer_type) :: answer
  type(error_type), allocatable :: error

  options%files = .false.   ! the results stay in memory
  call read_scene('doc/examples/bar.nml', scene, error)
  if (.not. allocated(error)) call run_scene(scene, options, error, answer=answer)
  if (allocated(error)) then
    print '(a)', error%message
    error stop
  end if
  print '(a, f0.2, a)', 'the wall holds the bar by ', answer%history(size(answer%history, 1), &
    & answer%column_number('wall_reaction_x')), ' N'
end program shortest
