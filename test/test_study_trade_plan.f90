!> Plans of studies: which runs they make, and what is wrong with them; the front and the orders.
module test_study_trade_plan
  use pd_base_error, only: scene_error => error_type
  use pd_base_kinds, only: wp
  use pd_scene_format_file, only: line_type
  use pd_study_trade_front, only: mark_front, observed_orders, on_front, order_type
  use pd_study_trade_lines, only: finest_of
  use pd_study_trade_plan, only: plan_from_text, plan_type
  use pd_study_trade_trial, only: outcome_type
  use bodies, only: expect, expect_true
  use test_scene_expect, only: changes_of, expect_parts, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_study_trade_plan

  character(*), parameter :: head = '&scene dimension = 2 /'//line// &
    & '&material youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.3 /'//line// &
    & "&body name = 'one' lower = 0, 0 upper = 1, 0.5 points = 20, 10 /"//line// &
    & "&body name = 'two' lower = 1, 0 upper = 1.5, 0.5 points = 10, 10 /"//line// &
    & '&time steps = 5 /'//line
  character(*), parameter :: rest = " measure = 'displacement' against = 'finest' /"//line

contains

  subroutine collect_study_trade_plan(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('groups make the product', test_product), &
      & new_unittest('groups go together', test_together), &
      & new_unittest('orders of a list of runs', test_listed_orders), &
      & new_unittest('points follow in proportion', test_points), &
      & new_unittest('levels of finer cells', test_levels), &
      & new_unittest('vectors take several values', test_vectors), &
      & new_unittest('columns', test_columns), &
      & new_unittest('invalid plans', test_refused), &
      & new_unittest('keys set on the command line', test_set), &
      & new_unittest('the Pareto front', test_front), &
      & new_unittest('observed orders', test_orders)]
  end subroutine collect_study_trade_plan

  subroutine planned(text, plan, error)
    character(*), intent(in) :: text
    type(plan_type), intent(out) :: plan
    type(error_type), allocatable, intent(inout) :: error
    type(scene_error), allocatable :: found
    if (allocated(error)) return
    call plan_from_text(head//text, 'a.nml', plan, found, [line_type ::])
    if (allocated(found)) call test_failed(error, found%message)
  end subroutine planned

  !> The first group is the slowest; each run's scene has its values and nobody else's.
  subroutine test_product(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan
    integer :: t

    call planned("&study vary = 'horizon%ratio' values = 2.0, 3.0"//rest// &
      & "&study vary = 'time%integrator' values = 'runge_kutta', 'velocity_verlet', "// &
      & "'adams_moulton' /", plan, error)
    if (allocated(error)) return
    call expect_true(error, size(plan%trials) == 6, 'six runs')
    if (allocated(error)) return
    do t = 1, 6
      call expect(error, plan%trials(t)%scene%horizon%ratio, merge(2.0_wp, 3.0_wp, t <= 3), &
        & 0.0_wp, 'ratio')
    end do
    call expect_true(error, plan%trials(1)%scene%time%integrator == 'runge_kutta' .and. &
      & plan%trials(2)%scene%time%integrator == 'velocity_verlet' .and. &
      & plan%trials(6)%scene%time%integrator == 'adams_moulton', 'integrators')
    call expect(error, plan%scene%horizon%ratio, 3.015_wp, 0.0_wp, 'the file''s own scene stays')
    call expect_true(error, plan%norm == 'relative' .and. plan%measure == 'displacement', &
      & 'what is measured may stand in any group')
  end subroutine test_product

  subroutine test_together(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan

    call planned("&study vary = 'time%safety' values = 0.2, 0.4"//rest// &
      & "&study vary = 'horizon%ratio' values = 2.0, 3.0 together = .true. /"//line// &
      & "&study vary = 'material%break_in_compression' values = .true., .false. /", plan, error)
    if (allocated(error)) return
    call expect_true(error, size(plan%trials) == 4, 'four runs')
    if (allocated(error)) return
    call expect(error, plan%trials(2)%scene%time%safety, 0.2_wp, 0.0_wp, 'safety')
    call expect(error, plan%trials(2)%scene%horizon%ratio, 2.0_wp, 0.0_wp, 'goes with ratio')
    call expect(error, plan%trials(3)%scene%time%safety, 0.4_wp, 0.0_wp, 'safety')
    call expect(error, plan%trials(3)%scene%horizon%ratio, 3.0_wp, 0.0_wp, 'goes with ratio')
    call expect_true(error, plan%trials(3)%scene%materials(1)%break_in_compression .and. &
      & .not. plan%trials(4)%scene%materials(1)%break_in_compression, 'the product with the third')
  end subroutine test_together

  !> Every run has them; a key that is varied cannot be set.
  subroutine test_set(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = head//"&study vary = 'horizon%ratio' values = 2.0, 3.0"//rest
    type(plan_type) :: plan
    type(scene_error), allocatable :: found
    type(line_type), allocatable :: changes(:)
    integer :: t

    call changes_of('time%safety=0.3|study%values=2.5, 3.5, 4.5', changes)
    call plan_from_text(text, 'a.nml', plan, found, changes)
    if (allocated(found)) then
      call test_failed(error, found%message)
      return
    end if
    call expect_true(error, size(plan%trials) == 3, 'three runs')
    if (allocated(error)) return
    do t = 1, 3
      call expect(error, plan%trials(t)%scene%horizon%ratio, t + 1.5_wp, 0.0_wp, 'ratio')
      call expect(error, plan%trials(t)%scene%time%safety, 0.3_wp, 0.0_wp, 'safety')
    end do
    call changes_of('ratio=4', changes)
    call plan_from_text(text, 'a.nml', plan, found, changes)
    call expect_parts(error, found, "'horizon%ratio' is set here and varied|--> the "// &
      & 'command line|--set ratio=4')
    if (allocated(error)) return
    call changes_of('study%values=0.5', changes)
    call plan_from_text(text, 'a.nml', plan, found, changes)
    call expect_parts(error, found, "'ratio' is out of range|--> the command line|^^^")
  end subroutine test_set

  !> 20 x 10 and 10 x 10 points: both bodies follow, unless the body is named by its number.
  subroutine test_points(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan
    type(scene_error), allocatable :: found

    call planned("&study vary = 'points' values = 6, 40"//rest, plan, error)
    if (allocated(error)) return
    call expect_true(error, all(plan%trials(1)%scene%bodies(1)%points(:2) == [6, 3]) .and. &
      & all(plan%trials(1)%scene%bodies(2)%points(:2) == [3, 3]), 'coarser')
    call expect_true(error, all(plan%trials(2)%scene%bodies(1)%points(:2) == [40, 20]) .and. &
      & all(plan%trials(2)%scene%bodies(2)%points(:2) == [20, 20]), 'finer')
    call expect(error, plan%trials(2)%points, 1200.0_wp, 0.0_wp, 'points in all')
    call expect(error, plan%trials(2)%spacing, 0.025_wp, 1.0e-15_wp, 'spacing')
    call expect_true(error, plan%trials(2)%work > 10*plan%trials(1)%work, 'more work')
    call planned("&study vary = 'body(2)%points' values = 20"//rest, plan, error)
    if (allocated(error)) return
    call expect_true(error, all(plan%trials(1)%scene%bodies(1)%points(:2) == [20, 10]) .and. &
      & all(plan%trials(1)%scene%bodies(2)%points(:2) == [20, 20]), 'one body')
    call plan_from_text(head//"&study vary = 'points' values = 40, 25"//rest, 'a.nml', plan, &
      & found, [line_type ::])
    call expect_parts(error, found, "bad value '25'|a.nml:6|expected a multiple of 2")
  end subroutine test_points

  !> Points, bonds and work of refined lattices are those of all levels; the most levels are the
  !> finest, and orders are those of the finest spacing.
  subroutine test_levels(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan
    type(outcome_type) :: outcomes(3)
    type(order_type), allocatable :: orders(:)
    character(:), allocatable :: reason
    integer :: finest, t

    ! of 300 cells those with x < 0.25: 50, and of 2 levels a rim of 4 columns of ten
    call planned("&refine shape = 'box' upper(1) = 0.25 levels = 1 /"//line// &
      & "&study vary = 'refine%levels' values = 1, 2"//rest, plan, error)
    if (allocated(error)) return
    call expect(error, plan%trials(1)%points, 250.0_wp + 50*4, 0.0_wp, 'points of a level')
    call expect(error, plan%trials(2)%points, 210.0_wp + 40*4 + 50*16, 0.0_wp, 'points of two')
    call expect(error, plan%trials(2)%bonds/plan%trials(1)%bonds, plan%trials(2)%points &
      & /plan%trials(1)%points, 1.0e-12_wp, 'bonds')
    call expect_true(error, plan%trials(2)%work > plan%trials(1)%work, 'work')
    call finest_of(plan, finest, reason)
    call expect_true(error, finest == 2, 'the finest run: '//reason)
    call planned("&refine shape = 'box' upper(1) = 0.25 levels = 1 /"//line// &
      & "&study vary = 'refine%levels' values = 1, 2, 3"//rest, plan, error)
    if (allocated(error)) return
    outcomes%done = .true.
    outcomes%judged = .true.
    do t = 1, 3
      outcomes(t)%error = 0.25_wp**t  ! a quarter with half of the spacing: second order
    end do
    call observed_orders(plan, outcomes, orders)
    call expect_true(error, size(orders) == 2, 'two orders')
    if (allocated(error)) return
    call expect(error, orders(1)%order, 2.0_wp, 1.0e-12_wp, 'order')
    call expect(error, orders(2)%order, 2.0_wp, 1.0e-12_wp, 'order')
  end subroutine test_levels

  subroutine test_vectors(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan
    type(scene_error), allocatable :: found
    character(*), parameter :: probe = "&probe name = 'p' point = 0, 0 /"//line

    call planned(probe//"&study vary = 'probe%point' values = 0.1, 0.2, 0.3, 0.4"//rest, plan, &
      & error)
    if (allocated(error)) return
    call expect_true(error, size(plan%trials) == 2, 'two runs')
    if (allocated(error)) return
    call expect(error, plan%trials(2)%scene%probes(1)%point(1), 0.3_wp, 0.0_wp, 'x')
    call expect(error, plan%trials(2)%scene%probes(1)%point(2), 0.4_wp, 0.0_wp, 'y')
    call plan_from_text(head//probe//"&study vary = 'probe%point' values = 0.1, 0.2, 0.3"//rest, &
      & 'a.nml', plan, found, [line_type ::])
    call expect_parts(error, found, '3 values are not a whole number of vectors|expected 2')
  end subroutine test_vectors

  subroutine test_columns(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan

    call planned("&study vary = 'ratio' values = 2.0, 3.0"//rest// &
      & "&study vary = 'points' values = 20 /"//line// &
      & "&study vary = 'steps' values = 2 /", plan, error)
    if (allocated(error)) return
    call expect_true(error, plan%variables(1)%name == 'ratio', 'as it is written')
    call expect_true(error, plan%variables(2)%name == 'body(1)%points', &
      & 'in full where the name is a column already: '//plan%variables(2)%name)
    call expect_true(error, plan%variables(3)%name == 'time%steps', plan%variables(3)%name)
  end subroutine test_columns

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error

    call refused('', 'the scene has no group &study')
    call refused("&study vary = 'ratio' values = 2 against = 'finest' /", &
      & "no group &study has the key 'measure'")
    call refused("&study vary = 'ratio' values = 2 measure = 'damage' /", &
      & "no group &study has the key 'against'")
    call refused("&study vary = 'ratio' values = 2"//rest//"&study vary = 'safety' values = 2 /", &
      & "'safety' is a key of several groups|time%safety|relaxation%safety")
    call refused("&study vary = 'ratio' values = 2, 0.5"//rest, "'ratio' is out of range|a.nml:6")
    call refused("&study vary = 'ratio' values = 2, 3"//rest//"&study vary = 'steps' "// &
      & 'values = 2, 3, 4 together = .true. /', '3 values go together with 2|expected as many')
    call refused("&study vary = 'ratio' values = 2"//rest//"&study vary = 'horizon%ratio' "// &
      & 'values = 3 /', 'this key is varied by another &study|a.nml:7')
    call refused("&study vary = 'ratio' values = 2"//rest//"&study vary = 'steps' values = 3 "// &
      & "against = 'analytic' /", "'against' differs between groups &study|it is 'finest'")
    call refused("&study vary = 'ratio' values = 2"//rest//"&study vary = 'steps' values = 3 "// &
      & "analytic = 'plate_hole' /", "'analytic' names a closed form, but 'against' is 'finest'")
    call refused("&study vary = 'output%fields' values = 'damage'"//rest, &
      & "'fields' is a text list|vary one element of it, as in fields(2)")
    call refused("&study vary = 'body(1)%points' values = 20, 40000"//rest, &
      & 'body(1)%points = 40000|of memory|only')

  contains

    subroutine refused(text, parts)
      character(*), intent(in) :: text, parts
      type(plan_type) :: plan
      type(scene_error), allocatable :: found
      if (allocated(error)) return
      call plan_from_text(head//text, 'a.nml', plan, found, [line_type ::])
      call expect_parts(error, found, parts)
    end subroutine refused
  end subroutine test_refused

  !> A run is beaten by one that is better in one respect and no worse in the other.
  subroutine test_front(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: e(7) = [4.0_wp, 2.0_wp, 2.0_wp, 3.0_wp, 1.0_wp, 0.1_wp, 2.0_wp]
    real(wp), parameter :: s(7) = [1.0_wp, 2.0_wp, 2.0_wp, 2.5_wp, 8.0_wp, 0.1_wp, 3.0_wp]

    call expect_true(error, all(on_front(e, s, [.true., .true., .true., .true., .true., .false., &
      & .true.]) .eqv. [.true., .true., .true., .false., .true., .false., .false.]), 'the front')
    call expect_true(error, count(on_front(e, s, spread(.true., 1, 7))) == 1, &
      & 'one that is best in both')
    call expect_true(error, all(on_front([1.0_wp, 2.0_wp], [3.0_wp, 3.0_wp], [.true., .true.]) &
      & .eqv. [.true., .false.]), 'as fast, but worse')
    call expect_true(error, all(on_front([2.0_wp, 2.0_wp], [3.0_wp, 4.0_wp], [.true., .true.]) &
      & .eqv. [.true., .false.]), 'as good, but slower')
  end subroutine test_front

  !> Errors ratio^2/points^1.5 over points 10, 20, 40: orders 1.5 for points, none for the ratio.
  subroutine test_orders(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan
    type(outcome_type) :: outcomes(6)
    type(order_type), allocatable :: orders(:)
    integer :: t

    call planned("&study vary = 'ratio' values = 2, 3"//rest// &
      & "&study vary = 'body%points' values = 40, 10, 20 /", plan, error)
    if (allocated(error)) return
    do t = 1, 6
      outcomes(t)%done = .true.
      outcomes(t)%judged = .true.
      outcomes(t)%error = plan%trials(t)%scene%horizon%ratio**2 &
        & /plan%trials(t)%scene%bodies(1)%points(1)**1.5_wp
      outcomes(t)%seconds = t
    end do
    call observed_orders(plan, outcomes, orders)
    call expect_true(error, size(orders) == 4, 'two steps on each of two lines')
    do t = 1, size(orders)
      call expect(error, orders(t)%order, 1.5_wp, 1.0e-12_wp, 'order')
      call expect_true(error, orders(t)%variable == 2, 'of the points')
    end do
    ! 10 -> 20 and 20 -> 40, whatever their order in the file
    call expect_true(error, any(orders%from == 2 .and. orders%to == 3) .and. &
      & any(orders%from == 3 .and. orders%to == 1), 'neighbours')
    outcomes(3)%judged = .false.
    call mark_front(outcomes)
    call expect_true(error, all(outcomes%pareto .eqv. [.true., .false., .false., .false., .false., &
      & .false.]), 'the front of them')
    outcomes(1)%truth = .true.
    call mark_front(outcomes)
    call expect_true(error, all(outcomes%pareto .eqv. [.false., .true., .false., .true., .false., &
      & .true.]) .or. outcomes(2)%pareto .and. .not. outcomes(1)%pareto, &
      & 'what others are compared with does not compete')
  end subroutine test_orders

  !> Groups in step that repeat values are a list of runs: errors safety^2/points, and orders of
  !> runs that differ in one of them alone.
  subroutine test_listed_orders(error)
    type(error_type), allocatable, intent(out) :: error
    type(plan_type) :: plan
    type(outcome_type) :: outcomes(4)
    type(order_type), allocatable :: orders(:)
    integer :: t

    call planned("&study vary = 'time%safety' values = 0.8, 0.8, 0.4, 0.4"//rest// &
      & "&study vary = 'body%points' values = 10, 20, 10, 40 together = .true. /", plan, error)
    if (allocated(error)) return
    do t = 1, 4
      outcomes(t)%done = .true.
      outcomes(t)%judged = .true.
      associate (scene => plan%trials(t)%scene)
        outcomes(t)%error = scene%time%safety**2/scene%bodies(1)%points(1)
      end associate
    end do
    call observed_orders(plan, outcomes, orders)
    call expect_true(error, size(orders) == 3, 'one of the safety, two of the points')
    if (allocated(error)) return
    call expect_true(error, all(orders%variable == [1, 2, 2]) .and. all(orders%from == [1, 1, 3]) &
      & .and. all(orders%to == [3, 2, 4]), 'which runs')
    call expect(error, orders(1)%order, 2.0_wp, 1.0e-12_wp, 'of the safety')
    call expect(error, orders(2)%order, 1.0_wp, 1.0e-12_wp, 'of the points')
    call expect(error, orders(3)%order, 1.0_wp, 1.0e-12_wp, 'of the points, smaller steps')
  end subroutine test_listed_orders

end module test_study_trade_plan
