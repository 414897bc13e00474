!> Boundaries in the history: reaction and mean displacement.
module test_output_measures_boundary
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_driver, only: run_scene
  use pd_output_fields_table, only: all_fields
  use pd_output_measures_measure, only: measure_list_type, row_source_type
  use pd_output_measures_table, only: measures_of
  use pd_output_report_begin, only: run_options_type
  use pd_output_results_answer, only: answer_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, expect_true
  implicit none (type, external)
  private
  public :: collect_output_measures_boundary

  real(wp), parameter :: spacing = 1.0e-2_wp

contains

  subroutine collect_output_measures_boundary(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the displacement of a boundary that is moved', test_moved), &
      & new_unittest('a mean weighted by volume', test_mean)]
  end subroutine collect_output_measures_boundary

  !> A plate whose right side is held in x and moved in y, and one boundary without a name.
  subroutine plate(scene)
    type(scene_type), intent(out) :: scene

    call box_scene([8, 5], spacing, 0.25_wp, scene)
    deallocate (scene%boundaries, scene%regions)
    allocate (scene%boundaries(3), scene%regions(1))
    scene%regions(1)%name = 'left'
    scene%regions(1)%shape = 'box'
    scene%regions(1)%upper(1) = 2.0_wp*spacing
    scene%boundaries(1)%name = 'right'
    scene%boundaries(1)%side = 'x_max'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%boundaries(1)%velocity(2) = 3.0_wp
    scene%boundaries(2)%side = 'y_min'
    scene%boundaries(2)%displacement(1) = 0.0_wp
    scene%boundaries(3)%name = 'left'
    scene%boundaries(3)%region = 'left'
    scene%boundaries(3)%displacement(2) = 1.0e-5_wp
    scene%time%steps = 12
    scene%output%history_every = 1
  end subroutine plate

  !> In every row the imposed displacement, the one that is not imposed as in the fields, and the
  !> columns of a boundary side by side.
  subroutine test_moved(error)
    type(error_type), allocatable, intent(out) :: error
    character(24), parameter :: names(8) = [character(24) :: 'right_reaction_x', &
      & 'right_reaction_y', 'right_displacement_x', 'right_displacement_y', 'left_reaction_x', &
      & 'left_reaction_y', 'left_displacement_x', 'left_displacement_y']
    type(scene_type) :: scene
    type(run_options_type) :: options
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: time(:), moved(:), u(:, :)
    logical, allocatable :: mine(:)
    integer :: first, n

    call plate(scene)
    scene%output%fields = [character(64) :: 'displacement']
    options%files = .false.
    options%quiet = .true.
    call run_scene(scene, options, fault, answer=answer)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    first = answer%column_number(trim(names(1)))
    call expect_true(error, first > 0, 'no column')
    if (allocated(error)) return
    call expect_true(error, all(answer%columns(first:first + 7)%name == names) .and. &
      & all(answer%columns(first:first + 7)%unit == [character(1) :: 'N', 'N', 'm', 'm', 'N', &
      & 'N', 'm', 'm']) .and. size(answer%columns) == first + 7, 'columns')
    call answer%get_column('time', time, fault)
    call answer%get_column('right_displacement_y', moved, fault)
    call expect_close(error, moved, 3*time, 1.0e-14_wp*3*maxval(time), 'imposed velocity')
    call answer%get_column('left_displacement_y', moved, fault)
    call expect_close(error, moved, 1.0e-5_wp, 1.0e-19_wp, 'imposed displacement')
    ! all points of the region have one volume
    call answer%get_column('left_displacement_x', moved, fault)
    call answer%get_field('displacement', u, fault)
    mine = answer%positions(:, 1) < 2*spacing .and. answer%positions(:, 2) > 0.0_wp
    n = size(moved)
    call expect_true(error, abs(moved(n)) > 0.0_wp .and. count(mine) == 10, 'nothing moves')
    call expect_close(error, moved(n), sum(u(:, 1), mask=mine)/count(mine), &
      & 1.0e-13_wp*max_abs(u(:, 1)), 'mean of the field')
  end subroutine test_moved

  !> Displacements and volumes as one likes.
  subroutine test_mean(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type), target :: set_up
    type(measure_list_type) :: measures
    type(row_source_type) :: now
    type(column_type), allocatable :: columns(:)
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: row(:)
    real(wp) :: volume, mean(2)
    integer :: k

    call plate(scene)
    call complete_scene(scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call measures_of(scene, all_fields(), measures)
    call measures%begin(scene, set_up%system, fault)
    columns = measures%columns(2)
    volume = 0.0_wp
    mean = 0.0_wp
    associate (system => set_up%system, body => set_up%system%body)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        body%volume(k) = body%volume(k)*(1 + mod(int(body%point(k)), 7))
        system%state%u(k, :) = 1.0e-4_wp*[sin(real(k, wp)), cos(0.3_wp*k)]
        if (body%layer(k) > 0 .or. body%x(k, 1) > 2*spacing) cycle
        volume = volume + body%volume(k)
        mean = mean + body%volume(k)*system%state%u(k, :)
      end do
      now%system => set_up%system
      call measures%row(now, row)
      call expect_true(error, columns(7)%name == 'left_displacement_x', 'columns')
      call expect_close(error, row(7:8), mean/volume, 1.0e-18_wp, 'mean')
    end associate
  end subroutine test_mean

end module test_output_measures_boundary
