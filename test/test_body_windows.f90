!> Points that ranks make in windows, each its own: against the body that is made in one piece and
!> then divided, bit by bit.
module test_body_windows
  use omp_lib, only: omp_get_num_threads, omp_get_thread_num
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i8
  use pd_base_lanes, only: lanes
  use pd_body_body, only: body_type
  use pd_body_division, only: divide_space, division_type, take_part, work_of_points
  use pd_body_generate, only: generate_body
  use pd_body_layers, only: layer_count_text, layer_count_type
  use pd_body_survey, only: survey_points, survey_type
  use pd_body_windows, only: begin_work, make_part, work_of_windows
  use pd_body_work, only: work_rule_type
  use pd_scene_content_types, only: scene_type
  use pd_set_up_ranks, only: bounds_of_bodies, find_lowest, rule_of_work, work_of_body
  use bodies, only: expect, expect_true
  use test_ranks, only: fake_type, hub_type
  use test_scene_expect, only: expect_scene, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_body_windows

  character(*), parameter :: head = '&material youngs_modulus = 1 density = 1 poissons_ratio = '// &
    & '0.25 /'//line//'&time steps = 1 /'//line
  character(*), parameter :: bar = '&scene dimension = 1 area = 2.0e-4 /'//line//head, &
    & plane = '&scene dimension = 2 thickness = 0.01 /'//line//head, &
    & space = '&scene dimension = 3 /'//line//head

  !> Scenes: full boxes; shapes; cuts by shapes, expressions and regions; layers at one side, behind
  !> bodies, at a round corner for which two layers reach; bodies of several spacings, of which one
  !> is cut away before the next cut; turned bodies; clouds, also beside lattices, and one whose
  !> finest points are cut away before the next cut; contact.
  character(*), parameter :: box = "&body lower = 0 0 0 upper = 1.3 0.7 0.9 points = 13 7 9 /"// &
    & line
  character(*), parameter :: square = "&body name = 'square' lower = 0 0 upper = 1 1 points = "// &
    & "40 40 /"//line
  character(*), parameter :: cloud_file = 'build/test-windows-cloud.txt'
  character(*), parameter :: cloud = "&body file = '"//cloud_file//"' /"//line
  character(700), parameter :: scenes(14) = [character(700) :: &
    & bar//'&body lower = 0.3 upper = 1.4 points = 200 /'//line// &
    & "&boundary side = 'x_max' displacement_x = 0 /"//line, &
    & space//box//"&boundary side = 'z_min' displacement_z = 0 /"//line// &
    & "&boundary side = 'x_max' displacement_x = 0 /"//line, &
    & space//"&body shape = 'sphere' centre = 1 2 3 radius = 0.5 spacing = 0.07 /"//line// &
    & "&remove shape = 'cone' centre = 1 2 3 direction = 1 1 0 angle = 50 /"//line// &
    & "&boundary side = 'y_max' displacement_y = 0 /"//line, &
    & plane//square//"&remove shape = 'sphere' centre = 1 1 radius = 0.07 /"//line// &
    & "&remove where = 'sin(40*x) > 0.9' /"//line// &
    & "&boundary side = 'x_max' displacement_x = 0 /"//line// &
    & "&boundary side = 'y_max' displacement_y = 0 /"//line, &
    & plane//square//"&region name = 'strip' where = 'x + y < 1.2' /"//line// &
    & "&keep region = 'strip' /"//line// &
    & "&keep shape = 'box' lower = 0.8 0.8 /"//line, &
    & plane//square//"&body name = 'fine' lower = 1 0 upper = 1.5 1 points = 40 80 /"//line// &
    & "&body name = 'block' lower = 0 2 upper = 0.5 2.5 points = 10 10 /"//line// &
    & "&boundary side = 'y_max' displacement_y = 0 /"//line// &
    & "&boundary side = 'x_max' body = 'fine' displacement_x = 0 /"//line, &
    & plane//square//"&body name = 'fine' lower = 2 0 upper = 2.1 0.1 points = 400 400 /"//line// &
    & "&remove shape = 'box' lower = 1.5 /"//line// &
    & "&remove shape = 'box' lower = 0.5125000001 0.5 upper = 0.8124999999 0.8 /"//line, &
    & plane//"&body lower = 0 0 upper = 1 0.5 points = 60 30 axis_1 = 2 1 /"//line// &
    & "&remove shape = 'sphere' centre = 0.3 0.4 radius = 0.1 /"//line, &
    & space//"&body shape = 'cylinder' centre = 0 0 0 axis = 'z' radius = 0.4 height = 1 "// &
    & "spacing = 0.1 axis_1 = 1 1 0 axis_2 = 0 1 1 /"//line// &
    & "&body lower = 3 0 0 upper = 3.5 0.5 0.5 points = 8 8 8 /"//line, &
    & plane//cloud, &
    & plane//square//cloud//"&remove shape = 'box' lower = 2.2 upper = 2.5 0.9 /"//line// &
    & "&remove shape = 'box' lower = 0.5125000001 0.5 upper = 0.8124999999 0.8 /"//line// &
    & "&boundary side = 'x_min' body = 'square' displacement_x = 0 /"//line, &
    & space//"&body name = 'block' lower = 0 0 0 upper = 1.3 0.7 0.9 points = 13 7 9 /"//line// &
    & cloud//"&keep where = 'y + z < 0.9' /"//line// &
    & "&boundary side = 'z_min' body = 'block' displacement_z = 0 /"//line, &
    & plane//square//"&body name = 'block' lower = 0.2 1 upper = 0.7 1.3 points = 20 12 /"//line// &
    & "&contact between = 'square', 'block' friction = 0.1 /"//line, &
    & plane//square//"&body name = 'ball' shape = 'sphere' centre = 1.3 0.5 radius = 0.28 "// &
    & "spacing = 0.02 /"//line//"&remove where = 'sin(40*x) > 0.6' /"//line// &
    & "&contact between = 'all' normals = 'centres' distance = 0.03 /"//line]

contains

  subroutine collect_body_windows(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('windows of any size have the points of the whole body', test_parts), &
      & new_unittest('ranks that count together find the same', test_together), &
      & new_unittest('what is refused, in the same words', test_refused), &
      & new_unittest('clouds that are refused, in the same words', test_refused_clouds)]
  end subroutine collect_body_windows

  !> Windows of one cell, of parts of rows, of rows, of planes, and of the whole body.
  subroutine test_parts(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: cells(5) = [1, 5, 48, 704, 1000000]
    type(scene_type) :: scene
    type(survey_type) :: survey
    type(fault_type), allocatable :: fault
    integer :: i, c

    call write_cloud()
    do i = 1, size(scenes)
      call expect_scene(error, trim(scenes(i)), scene)
      if (allocated(error)) return
      do c = 1, size(cells)
        ! a window for each cell takes long
        if (cells(c) < lanes .and. i > 3) cycle
        call survey_points(scene, survey, fault, cells=cells(c))
        if (allocated(fault)) call test_failed(error, fault%message)
        if (allocated(error)) return
        call compare(scene, survey, i, mod(cells(c), lanes) == 0, error)
        if (allocated(error)) return
      end do
    end do
    call remove_cloud()
  end subroutine test_parts

  !> A cloud in the plane z = 0.3, finer where x is larger, in an order without any order in space.
  subroutine write_cloud()
    integer, parameter :: n = 431
    integer :: unit, i
    real(wp) :: h, x, y

    open (newunit=unit, file=cloud_file, status='replace', action='write')
    write (unit, '(a)') '# x y z volume'
    do i = 1, n
      x = mod(i*0.618034_wp, 1.0_wp)
      y = mod(i*0.7548777_wp, 1.0_wp)
      h = 0.05_wp - 0.03_wp*x
      write (unit, '(3(es24.16, 1x), es24.16)') 1.5_wp + x, y, 0.3_wp, 0.01_wp*h**2
    end do
    close (unit)
  end subroutine write_cloud

  subroutine remove_cloud()
    integer :: unit
    open (newunit=unit, file=cloud_file)
    close (unit, status='delete')
  end subroutine remove_cloud

  !> All that a survey and the parts of ranks know of the points.
  subroutine compare(scene, survey, number, whole_blocks, error)
    type(scene_type), intent(in), target :: scene
    type(survey_type), intent(in), target :: survey
    integer, intent(in) :: number
    logical, intent(in) :: whole_blocks   !! windows have whole blocks of cells
    type(error_type), allocatable, intent(inout) :: error
    type(layer_count_type), allocatable :: counts(:)
    type(fault_type), allocatable :: fault
    type(body_type) :: whole, of_rank, part
    type(work_of_points) :: work
    type(work_of_windows) :: of_windows
    type(work_rule_type) :: costs, same_costs
    type(division_type) :: division, same
    integer, allocatable :: owner(:), owner_of_part(:)
    real(wp), dimension(3, size(scene%bodies)) :: lower, upper
    real(wp) :: delta
    integer :: ranks, r, g, blocks, l

    call generate_body(scene, whole, delta, fault, counts)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call expect_true(error, whole%n_points > 150, 'a scene of a few points')
    call expect_true(error, survey%none%order%n_global == whole%n_points, 'the number of points')
    call expect(error, survey%none%delta, delta, 0.0_wp, 'the horizon')
    call expect(error, survey%none%least_spacing, minval(whole%spacing), 0.0_wp, 'least spacing')
    call expect(error, survey%none%largest_spacing, maxval(whole%spacing), 0.0_wp, 'spacing')
    call expect_true(error, size(survey%counts) == size(counts), 'layers')
    if (allocated(error)) return
    do l = 1, size(counts)
      call expect_true(error, survey%counts(l)%columns == counts(l)%columns, 'columns')
      call expect_true(error, layer_count_text(scene, survey%counts(l)) &
        & == layer_count_text(scene, counts(l)), 'what columns came to')
    end do
    ! the corner is round, and the body that is cut away leaves none behind
    if (number == 4) call expect_true(error, counts(2)%shared > 0, 'no cell for two layers')
    call find_lowest(whole)
    do g = 1, size(whole%grids)
      if (.not. allocated(whole%grids(g)%lowest)) cycle
      call expect_true(error, all(abs(survey%lowest(:whole%dim, g) - whole%grids(g)%lowest) &
        & <= 0.0_wp), 'the lowest point of a grid')
    end do
    call bounds_of_bodies(whole, lower, upper)
    call rule_of_work(scene, delta, maxval(whole%spacing), lower, upper, costs)
    call rule_of_work(scene, delta, maxval(whole%spacing), survey%lower, survey%upper, same_costs)
    call expect_true(error, size(costs%zones) == size(same_costs%zones), 'zones of contact')
    call expect_true(error, size(costs%zones) > 0 .eqv. size(scene%contacts) > 0, 'no zone')
    if (allocated(error)) return
    do ranks = 1, 6
      blocks = merge(8, 1, ranks == 2)
      call work_of_body(whole, blocks, work, costs)
      call divide_space(work, ranks, division)
      call begin_work(scene, survey, same_costs, blocks, of_windows)
      call divide_space(of_windows, ranks, same)
      ! windows that cut blocks of cells make more of them
      if (whole_blocks) call expect_true(error, all(same%axis == division%axis) .and. &
        & all(same%half == division%half) .and. all(abs(same%at - division%at) <= 0.0_wp) .and. &
        & all(abs(same%work - division%work) <= 0.0_wp), 'the division')
      if (allocated(error)) return
      do r = 0, ranks - 1
        of_rank = whole
        call take_part(division, r, delta, of_rank, owner)
        call make_part(scene, survey, division, r, delta, part, owner_of_part)
        call same_bodies(of_rank, part, error)
        call expect_true(error, size(owner) == size(owner_of_part), 'copies')
        if (allocated(error)) return
        call expect_true(error, all(owner == owner_of_part), 'owners of copies')
      end do
    end do
  end subroutine compare

  !> Bodies in point order, with the same points.
  subroutine same_bodies(one, other, error)
    type(body_type), intent(in) :: one, other
    type(error_type), allocatable, intent(inout) :: error

    call expect_true(error, one%n_points == other%n_points, 'the number of points of a rank')
    call expect_true(error, one%order%n_owned == other%order%n_owned, 'those that it owns')
    call expect_true(error, one%order%n_global == other%order%n_global, 'those of all')
    call expect_true(error, size(one%grids) == size(other%grids), 'grids')
    if (allocated(error)) return
    call expect_true(error, all(one%number == other%number), 'numbers')
    call expect_true(error, all(abs(one%x - other%x) <= 0.0_wp), 'positions')
    call expect_true(error, all(abs(one%volume - other%volume) <= 0.0_wp), 'volumes')
    call expect_true(error, all(abs(one%spacing - other%spacing) <= 0.0_wp), 'spacings')
    call expect_true(error, all(one%body == other%body), 'bodies')
    call expect_true(error, all(one%material == other%material), 'materials')
    call expect_true(error, all(one%layer == other%layer), 'layers')
    call expect_true(error, all(one%grid == other%grid), 'grids of points')
    call expect(error, other%delta, one%delta, 0.0_wp, 'horizon')
  end subroutine same_bodies

  !> Ranks as threads, which share the windows while they count: each makes its part.
  subroutine test_together(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: ranks = 3
    type(scene_type), target :: scene
    type(survey_type), target :: survey(ranks), alone
    type(fake_type), target :: fake(ranks)
    type(hub_type), target :: hub
    type(fault_type), allocatable :: fault
    type(work_of_windows) :: work
    type(work_rule_type) :: costs
    type(division_type) :: division(ranks), expected
    type(body_type) :: part(ranks), of_rank
    integer, allocatable :: owner(:)
    logical :: enough, failed
    integer :: i, r

    call write_cloud()
    do i = 1, size(scenes)
      call expect_scene(error, trim(scenes(i)), scene)
      if (allocated(error)) return
      if (allocated(hub%of_rank)) deallocate (hub%of_rank)
      allocate (hub%of_rank(ranks))
      enough = .false.
      failed = .false.
      !$omp parallel num_threads(ranks) default(none) private(r, fault, work, costs, owner) &
      !$omp shared(scene, survey, fake, hub, division, part, enough, failed)
      if (omp_get_num_threads() == ranks) then
        r = omp_get_thread_num() + 1
        if (r == 1) enough = .true.
        fake(r)%rank = r
        fake(r)%hub => hub
        call survey_points(scene, survey(r), fault, fake(r), r - 1, ranks, 40)
        if (allocated(fault)) then
          failed = .true.
        else
          call rule_of_work(scene, survey(r)%none%delta, survey(r)%none%largest_spacing, &
            & survey(r)%lower, survey(r)%upper, costs)
          call begin_work(scene, survey(r), costs, 1, work)
          call divide_space(work, ranks, division(r))
          call make_part(scene, survey(r), division(r), r - 1, survey(r)%none%delta, part(r), owner)
        end if
      end if
      !$omp end parallel
      if (.not. enough) return   ! a machine that has no threads to give
      call expect_true(error, .not. failed, 'the points cannot be counted')
      call survey_points(scene, alone, fault)
      if (allocated(error) .or. allocated(fault)) return
      call rule_of_work(scene, alone%none%delta, alone%none%largest_spacing, alone%lower, &
        & alone%upper, costs)
      call begin_work(scene, alone, costs, 1, work)
      call divide_space(work, ranks, expected)
      do r = 1, ranks
        call expect_true(error, all(abs(division(r)%at - expected%at) <= 0.0_wp), 'cuts')
        call make_part(scene, alone, expected, r - 1, alone%none%delta, of_rank, owner)
        call same_bodies(of_rank, part(r), error)
        if (allocated(error)) return
      end do
    end do
    call remove_cloud()
  end subroutine test_together

  !> The error of a scene that is made in one piece names the same point.
  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: whole = plane//square
    character(200), parameter :: faults(6) = [character(200) :: &
      & "&remove shape = 'box' lower = 0 0.1 upper = 1 0.2 /"//line// &
      & "&remove where = '1/max(0, (x - 0.0125)**2 + (y - 0.5125)**2 - 1.0e-6)' /"//line, &
      & "&remove shape = 'box' lower = -1 /"//line, &
      & "&keep shape = 'box' lower = 5 /"//line, &
      & "&boundary side = 'x_min' displacement_x = 0 /"//line//"&horizon length = 0.01 /"//line, &
      & "&body shape = 'sphere' centre = 2 2 radius = 1.0e-3 spacing = 0.1 /"//line, &
      & cloud//"&remove where = '1/max(0, (x - 1.5)**2 - 0.1) - 1e6' /"//line]
    type(scene_type) :: scene
    type(survey_type) :: survey
    type(fault_type), allocatable :: fault, of_windows
    type(body_type) :: body
    real(wp) :: delta
    integer :: i

    call write_cloud()
    do i = 1, size(faults)
      call expect_scene(error, whole//trim(faults(i)), scene)
      if (allocated(error)) return
      call generate_body(scene, body, delta, fault)
      call survey_points(scene, survey, of_windows, cells=33)
      call expect_true(error, allocated(fault) .and. allocated(of_windows), 'no error')
      if (allocated(error)) return
      call expect_true(error, fault%message == of_windows%message, of_windows%message)
    end do
    call remove_cloud()
  end subroutine test_refused

  !> The first point at fault of a cloud's file is reported, whichever window has it.
  subroutine test_refused_clouds(error)
    type(error_type), allocatable, intent(out) :: error
    character(40), parameter :: rows(5) = [character(40) :: '1 2 0.3 0', '1 2 0.3 -1', &
      & '1 2 0.31 1e-5', '1 2 0.3', '1 2 0.3 x']
    type(scene_type) :: scene
    type(survey_type) :: survey
    type(fault_type), allocatable :: fault, of_windows
    type(body_type) :: body
    real(wp) :: delta
    integer :: i, unit

    call write_cloud()
    call expect_scene(error, plane//square//cloud, scene)
    if (allocated(error)) return
    do i = 1, size(rows)
      call write_cloud()
      open (newunit=unit, file=cloud_file, status='old', action='write', position='append')
      write (unit, '(a)') trim(rows(i)), '1 2 0.3 1e-5', '1 2 0.3 -5'
      close (unit)
      call generate_body(scene, body, delta, fault)
      call survey_points(scene, survey, of_windows, cells=33)
      call expect_true(error, allocated(fault) .and. allocated(of_windows), 'no error')
      if (allocated(error)) return
      call expect_true(error, fault%message == of_windows%message, of_windows%message)
      call expect_true(error, index(fault%message, cloud_file//':433') > 0, fault%message)
    end do
    call remove_cloud()
  end subroutine test_refused_clouds

end module test_body_windows
