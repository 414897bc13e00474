!> How often rows of the history are written.
module test_output_report_schedule
  use pd_base_kinds, only: i8, wp
  use pd_set_up_plan, only: plan_type
  use pd_motion_explicit_time_step, only: evaluations
  use pd_output_report_schedule, only: history_interval
  use pd_scene_content_types, only: scene_type
  use testdrive, only: check, error_type, new_unittest, unittest_type
  use bodies, only: expect_true
  implicit none (type, external)
  private
  public :: collect_output_report_schedule

contains

  subroutine collect_output_report_schedule(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('rows take a twentieth of the time at most', test_rows), &
      & new_unittest('rows of small bodies and of long runs', test_other_rows)]
  end subroutine collect_output_report_schedule

  !> A row takes the time of two evaluations of the forces at most (1.35 to 2.0 were measured).
  subroutine test_rows(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: integrators(*) = [character(16) :: 'forward_backward', &
      & 'adams_moulton', 'runge_kutta']
    integer, parameter :: steps(*) = [1000, 1250, 3999, 4001, 100000]
    type(scene_type) :: scene
    type(plan_type) :: plan
    integer :: i, j, every
    real(wp) :: share

    do i = 1, size(integrators)
      do j = 1, size(steps)
        plan%integrator = trim(integrators(i))
        plan%steps = steps(j)
        every = history_interval(scene, plan, 7000000_i8)
        share = 2.0_wp*(steps(j)/every)/(real(steps(j), wp)*evaluations(plan%integrator))
        call expect_true(error, share <= 0.05_wp .and. (share >= 0.03_wp .or. steps(j) > 4000), &
          & 'rows of '//integrators(i))
        if (allocated(error)) return
      end do
    end do
  end subroutine test_rows

  subroutine test_other_rows(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(plan_type) :: plan

    plan%integrator = 'forward_backward'
    plan%steps = 1000
    call check(error, history_interval(scene, plan, 5000_i8), 1, 'rows of a bar')
    if (allocated(error)) return
    plan%steps = 1000000
    call check(error, history_interval(scene, plan, 7000000_i8), 500, 'rows of a long run')
    if (allocated(error)) return
    scene%output%history_every = 3
    call check(error, history_interval(scene, plan, 7000000_i8), 3, 'rows as asked for')
    if (allocated(error)) return
    scene%output%history_every = 0
    plan%relaxes = .true.
    plan%relaxation%maximum_iterations = 100000
    call check(error, history_interval(scene, plan, 7000000_i8), 1, 'lines of a relaxation')
  end subroutine test_other_rows

end module test_output_report_schedule
