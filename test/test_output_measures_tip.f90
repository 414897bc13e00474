!> Tips of cracks: patterns of damage whose path, length, speed and fronts are known.
module test_output_measures_tip
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_snapshot, only: snapshot_type
  use pd_base_warnings, only: warnings_type
  use pd_motion_system, only: system_type
  use pd_output_fields_table, only: all_fields
  use pd_output_measures_measure, only: measure_list_type, row_source_type
  use pd_output_measures_table, only: measures_of
  use pd_output_results_types, only: column_type
  use pd_scene_content_complete, only: complete_scene
  use pd_scene_content_types, only: scene_type, tip_group, unset
  use pd_set_up_prepare, only: prepare, set_up_type
  use comparisons, only: expect_close
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use bodies, only: box_scene, expect_true
  use test_scene_expect, only: expect_fault, expect_parts, good_head, line
  implicit none (type, external)
  private
  public :: collect_output_measures_tip

  real(wp), parameter :: spacing = 1.0e-3_wp
  real(wp), parameter :: dt = 2.0e-7_wp        !! between rows [s]
  real(wp), parameter :: exact = 1.0e-12_wp    !! some roundings, relative

contains

  subroutine collect_output_measures_tip(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('a straight crack of known speed', test_straight), &
      & new_unittest('a stand before and after the growth', test_stand), &
      & new_unittest('a crack with a kink', test_kink), &
      & new_unittest('gaps and points that are hardly damaged', test_gaps), &
      & new_unittest('a crack that branches', test_branches), &
      & new_unittest('a slanted front in 3D', test_front), &
      & new_unittest('the state goes on after a restart', test_state), &
      & new_unittest('tips that find nothing cause a warning', test_warnings), &
      & new_unittest('what cannot be measured is refused', test_refused)]
  end subroutine collect_output_measures_tip

  !> A body of points that can be damaged, with one tip.
  subroutine begin(points, tip, set_up, measures, error)
    integer, intent(in) :: points(:)      !! along each direction
    type(tip_group), intent(in) :: tip
    type(set_up_type), intent(out) :: set_up
    type(measure_list_type), intent(out) :: measures
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call box_scene(points, spacing, 0.25_wp, scene)
    scene%materials(1)%critical_stretch = 0.01_wp
    scene%tips = [tip]
    call complete_scene(scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (.not. allocated(fault)) then
      call measures_of(scene, all_fields(), measures)
      call measures%begin(scene, set_up%system, fault)
    end if
    if (allocated(fault) .and. .not. allocated(error)) call test_failed(error, fault%message)
  end subroutine begin

  !> Damage the point of a cell.
  subroutine crack_at(system, cell, damage)
    type(system_type), intent(inout) :: system
    integer, intent(in) :: cell(:)       !! from 1 along each direction
    real(wp), intent(in) :: damage
    integer :: k

    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0) cycle
      if (any(nint(system%body%x(k, :)/spacing + 0.5_wp) /= cell)) cycle
      system%state%damage(k) = damage
      system%broken = system%broken + 1_i8
      return
    end do
  end subroutine crack_at

  !> The row of an instant.
  subroutine take_row(system, measures, n, row)
    type(system_type), target, intent(inout) :: system
    type(measure_list_type), intent(inout) :: measures
    integer, intent(in) :: n             !! its number
    real(wp), allocatable, intent(out) :: row(:)
    type(row_source_type) :: now

    now%system => system
    now%instant%step = n
    now%instant%time = n*dt
    call measures%row(now, row)
  end subroutine take_row

  !> Two rows of points crack from the side on, one column for each row of the history. The tip is
  !> in the lower one (the same distance, the lower number) half a spacing beside the way, so the
  !> first step of the path is a diagonal of half a cell. The speed is that of one spacing a row.
  subroutine test_straight(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    type(column_type), allocatable :: columns(:)
    real(wp), allocatable :: row(:)
    character(12), parameter :: names(6) = [character(12) :: 'a_x', 'a_y', 'a_length', &
      & 'a_projection', 'a_speed', 'a_branches']
    real(wp) :: way
    integer :: n

    call begin([30, 12], tip_group(name='a', from=[0.0_wp, 6*spacing, unset], &
      & direction=[3.0_wp, 0.0_wp, unset]), set_up, measures, error)
    if (allocated(error)) return
    columns = measures%columns(2)
    call expect_true(error, all(columns%name == names), 'names of columns')
    call take_row(set_up%system, measures, 0, row)
    call expect_close(error, row, [0.0_wp, 6*spacing, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 0.0_wp, &
      & 'before any damage')
    do n = 1, 25
      call crack_at(set_up%system, [n, 6], 0.4_wp)
      call crack_at(set_up%system, [n, 7], 0.4_wp)
      call take_row(set_up%system, measures, n, row)
      way = (n - 0.5_wp)*spacing
      call expect_close(error, row([1, 2, 3, 4, 6]), [way, 5.5_wp*spacing, way + (sqrt(0.5_wp) &
        & - 0.5_wp)*spacing, way, 1.0_wp], exact, 'the tip')
      ! the first step of the way is half a spacing, which the window of the speed contains until
      ! the crack is 10 spacings longer
      if (n > 11) call expect_close(error, row(5), spacing/dt, exact*spacing/dt, 'its speed')
    end do
  end subroutine test_straight

  !> A time of waiting before the growth does not count, one after it does. 2 columns in 3 rows are
  !> a stair that leaves its straight line by a third of a column at most either way: over 10
  !> columns the slope is within 3 % of the speed.
  subroutine test_stand(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    real(wp), allocatable :: row(:)
    real(wp) :: speed, t, p, tt, tp
    integer :: n, column

    call begin([40, 6], tip_group(name='a', from=[0.5_wp*spacing, 3.5_wp*spacing, unset], &
      & direction=[1.0_wp, 0.0_wp, unset]), set_up, measures, error)
    if (allocated(error)) return
    call crack_at(set_up%system, [1, 4], 0.4_wp)
    do n = 0, 20
      call take_row(set_up%system, measures, n, row)
      call expect_close(error, row(5), 0.0_wp, 0.0_wp, 'speed of a crack that stands')
    end do
    speed = 2.0_wp/3.0_wp*spacing/dt
    column = 1
    do n = 21, 70
      if (mod(n - 20, 3) /= 0) then
        column = column + 1
        call crack_at(set_up%system, [column, 4], 0.4_wp)
      end if
      call take_row(set_up%system, measures, n, row)
      if (n == 21) call expect_close(error, row(5), spacing/dt, exact*spacing/dt, 'first step')
      if (n > 37) call expect_close(error, row(5), speed, 0.03_wp*speed, 'speed')
    end do
    t = row(5)
    do n = 71, 100
      call take_row(set_up%system, measures, n, row)
      call expect_true(error, row(5) > 0.0_wp .and. row(5) < t, 'the speed of an arrest falls')
      t = row(5)
    end do
    ! all rows of the window at once: from the last one that lies 10 columns back
    t = 0.0_wp
    p = 0.0_wp
    tt = 0.0_wp
    tp = 0.0_wp
    column = 0
    do n = 21, 100
      if (projection_at(n) < projection_at(100) - 10) cycle
      if (projection_at(n) < projection_at(100) - 9 .and. projection_at(n + 1) < &
        & projection_at(100) - 9) cycle
      column = column + 1
      t = t + n
      p = p + projection_at(n)
      tt = tt + n*n
      tp = tp + n*projection_at(n)
    end do
    speed = (column*tp - t*p)/(column*tt - t*t)*spacing/dt
    call expect_close(error, row(5), speed, 1.0e-10_wp*speed, 'the slope by the usual formula')

  contains

    !> Columns cracked in row `n` of the history, less one.
    pure integer function projection_at(n)
      integer, intent(in) :: n
      projection_at = min(n, 70) - 20 - (min(n, 70) - 20)/3
    end function projection_at
  end subroutine test_stand

  !> 20 columns along x, then a diagonal: every step of the latter is sqrt(2) long.
  subroutine test_kink(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    real(wp), allocatable :: row(:)
    integer :: n

    call begin([36, 24], tip_group(name='a', from=[0.5_wp*spacing, 4.5_wp*spacing, unset], &
      & direction=[1.0_wp, 0.0_wp, unset]), set_up, measures, error)
    if (allocated(error)) return
    do n = 1, 35
      call crack_at(set_up%system, [n, 5 + max(0, n - 20)], 0.4_wp)
      call take_row(set_up%system, measures, n, row)
      call expect_close(error, row([1, 2, 3, 4, 6]), [(n - 0.5_wp)*spacing, (4.5_wp + max(0, &
        & n - 20))*spacing, (min(n, 20) - 1 + sqrt(2.0_wp)*max(0, n - 20))*spacing, &
        & (n - 1)*spacing, 1.0_wp], exact, 'the tip')
    end do
  end subroutine test_kink

  !> Steps of two spacings are too long; when a gap closes, all beyond it belongs to the crack.
  subroutine test_gaps(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    real(wp), allocatable :: row(:)
    integer :: n

    call begin([24, 8], tip_group(name='a', from=[0.0_wp, 4.5_wp*spacing, unset], &
      & direction=[1.0_wp, 0.0_wp, unset], threshold=0.3_wp), set_up, measures, error)
    if (allocated(error)) return
    do n = 1, 20
      call crack_at(set_up%system, [n, 5], merge(0.3_wp, 0.31_wp, n == 8 .or. n == 14))
    end do
    call take_row(set_up%system, measures, 1, row)
    call expect_close(error, row(4), 6.5_wp*spacing, exact, 'up to the first gap')
    call crack_at(set_up%system, [14, 6], 0.4_wp)
    call take_row(set_up%system, measures, 2, row)
    call expect_close(error, row(4), 6.5_wp*spacing, exact, 'the second gap is closed')
    call crack_at(set_up%system, [8, 4], 0.4_wp)
    call take_row(set_up%system, measures, 3, row)
    call expect_close(error, row([1, 3, 4, 6]), [19.5_wp, 19.5_wp, 19.5_wp, 1.0_wp] &
      & *[spacing, spacing, spacing, 1.0_wp], exact, 'both gaps are closed')
  end subroutine test_gaps

  !> Two arms at 45 degrees: they are two as soon as the fork is more than 5 spacings behind the
  !> tip. When one of them stops, it is one again.
  subroutine test_branches(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    real(wp), allocatable :: row(:)
    integer :: n, m

    call begin([40, 40], tip_group(name='a', from=[0.0_wp, 19.5_wp*spacing, unset], &
      & direction=[1.0_wp, 0.0_wp, unset]), set_up, measures, error)
    if (allocated(error)) return
    do n = 1, 15
      call crack_at(set_up%system, [n, 20], 0.4_wp)
      call take_row(set_up%system, measures, n, row)
      call expect_close(error, row(6), 1.0_wp, 0.0_wp, 'fronts of a straight crack')
    end do
    do m = 1, 18
      call crack_at(set_up%system, [15 + m, 20 - m], 0.4_wp)
      if (m <= 10) call crack_at(set_up%system, [15 + m, 20 + m], 0.4_wp)
      call take_row(set_up%system, measures, 15 + m, row)
      call expect_close(error, row(6), real(merge(2, 1, m > 5 .and. m <= 15), wp), 0.0_wp, &
        & 'fronts of arms')
      call expect_close(error, row([2, 4]), [19.5_wp - m, 14.5_wp + m]*spacing, exact, &
        & 'one of them is the tip')
    end do
  end subroutine test_branches

  !> A plane crack whose front leads by a column for each row across: over the shortest edge (y)
  !> the mean, the least and the most; over the other one, which it fills at one place, one value.
  subroutine test_front(error)
    type(error_type), allocatable, intent(out) :: error
    character(1), parameter :: across(3) = ['y', ' ', 'z']
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    type(column_type), allocatable :: columns(:)
    real(wp), allocatable :: row(:)
    real(wp) :: most, least
    integer :: n, i, j, w

    do w = 1, 3
      call begin([16, 5, 7], tip_group(name='a', from=[0.0_wp, 0.0_wp, 3.5_wp*spacing], &
        & direction=[1.0_wp, 0.0_wp, 0.0_wp], across=across(w)), set_up, measures, error)
      if (allocated(error)) return
      columns = measures%columns(3)
      call expect_true(error, size(columns) == 10 .and. columns(10)%name == 'a_projection_most' &
        & .and. columns(8)%name == 'a_projection_mean', 'names of columns')
      do n = 1, 10
        do j = 1, 5
          do i = 1, n + j
            call crack_at(set_up%system, [i, j, 4], 0.5_wp)
          end do
        end do
        call take_row(set_up%system, measures, n, row)
        most = (n + 4.5_wp)*spacing
        least = merge((n + 0.5_wp)*spacing, most, w < 3)
        call expect_close(error, row([1, 2, 3, 5, 7, 8, 9, 10]), [most, 4.5_wp*spacing, &
          & 3.5_wp*spacing, most, 1.0_wp, (most + least)/2, least, most], exact, 'front')
      end do
    end do
  end subroutine test_front

  !> Kept and put back into a measure that is new, a tip goes on with the same bits.
  subroutine test_state(error)
    type(error_type), allocatable, intent(out) :: error
    type(tip_group) :: tip
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures, later
    type(snapshot_type) :: archive
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: row(:), again(:)
    integer :: n

    tip = tip_group(name='a', from=[0.0_wp, 6*spacing, unset], direction=[1.0_wp, 0.2_wp, unset])
    call begin([30, 14], tip, set_up, measures, error)
    if (allocated(error)) return
    call box_scene([30, 14], spacing, 0.25_wp, scene)
    scene%tips = [tip]
    do n = 1, 25
      call crack_at(set_up%system, [n, 7 + n/5], 0.4_wp)
      if (mod(n, 3) == 0) call crack_at(set_up%system, [n, 6], 0.4_wp)
      call take_row(set_up%system, measures, n, row)
      if (n > 1) then
        call take_row(set_up%system, later, n, again)
        call expect_true(error, all(transfer(row, 0_i8, size(row)) == transfer(again, 0_i8, &
          & size(row))), 'other bits after a restart')
      end if
      call archive%rewind(reading=.false.)
      call measures%keep(archive)
      call measures_of(scene, all_fields(), later)
      call later%begin(scene, set_up%system, fault)
      call archive%rewind(reading=.true.)
      call later%keep(archive)
      call expect_true(error, .not. (allocated(archive%error) .or. allocated(fault)), 'the archive')
      if (allocated(error)) return
    end do
  end subroutine test_state

  !> Beside a straight crack 4 of 12 family members are beyond it at 2 spacings, and 11 of 28 at 3
  !> (all weights are 1 but for those at the rim, which count half or less).
  subroutine test_warnings(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    type(warnings_type) :: warnings(3)
    type(fault_type), allocatable :: fault
    integer :: w

    do w = 1, 3
      call box_scene([20, 20], spacing, 0.25_wp, scene)
      scene%materials(1)%critical_stretch = 0.01_wp
      scene%horizon%ratio = merge(2.015_wp, 3.015_wp, w == 1)
      scene%tips = [tip_group(name='a', from=[merge(1.0_wp, 0.0_wp, w == 2), 0.0_wp, unset], &
        & direction=[1.0_wp, 0.0_wp, unset])]
      call complete_scene(scene, fault)
      if (.not. allocated(fault)) call prepare(scene, set_up, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call measures_of(scene, all_fields(), measures)
      call measures%begin(scene, set_up%system, fault)
      call measures%warn(set_up%system, warnings(w))
      call check(error, warnings(w)%count(), merge(0, 1, w == 3))
      if (allocated(error)) return
      if (w == 1) call expect_true(error, index(warnings(w)%line(1), 'beside a straight') > 0, &
        & warnings(w)%line(1))
      if (w == 2) call expect_true(error, index(warnings(w)%line(1), 'no point lies within') > 0, &
        & warnings(w)%line(1))
      if (allocated(error)) return
    end do
  end subroutine test_warnings

  !> A scene without damage; a direction without length; an axis that a front cannot have; two
  !> groups whose columns have one name.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: head = good_head//'&time steps = 1 /'//line
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(measure_list_type) :: measures
    type(fault_type), allocatable :: fault

    call expect_fault(error, head//"&tip name = 'a' from = 0, 0 direction = 0, 0 /", &
      & "'direction' has no length|expected a vector")
    call expect_fault(error, head//"&tip name = 'a' from = 0, 0 direction = 1, 0 across = 'y' /", &
      & "'across' is given in 2D")
    call expect_fault(error, head//"&tip name = 'a' from = 0 direction = 1, 0 /", &
      & "'from' has too few values")
    call expect_fault(error, head//"&tip name = 'a' from = 0, 0 direction = 1, 0 /"//line// &
      & "&tip name = 'a' from = 0, 0 direction = 0, 1 /", "the name 'a' is used by another &tip")
    call expect_fault(error, head//"&tip name = 'a' from = 0, 0 direction = 1, 0 threshold = 1 /", &
      & 'threshold')
    if (allocated(error)) return
    call box_scene([6, 6], spacing, 0.25_wp, scene)
    scene%tips = [tip_group(name='a', from=[0.0_wp, 0.0_wp, unset], &
      & direction=[1.0_wp, 0.0_wp, unset])]
    call complete_scene(scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call measures_of(scene, all_fields(), measures)
    call measures%begin(scene, set_up%system, fault)
    call expect_parts(error, fault, 'no bond can break|expected a material with critical_stretch')
    if (allocated(error)) return
    deallocate (scene%probes)
    allocate (scene%probes(1))
    scene%probes(1)%name = 'a'
    scene%probes(1)%fields = [character(64) :: 'displacement', 'damage']
    scene%tips(1)%name = 'a_displacement'
    call measures_of(scene, all_fields(), measures)
    call measures%begin(scene, set_up%system, fault)
    call expect_parts(error, fault, "'a_displacement_x', of a probe and of a tip")
  end subroutine test_refused

end module test_output_measures_tip
