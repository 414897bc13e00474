!> Contact finds what is near from step to step: in runs with bodies that come as fast as they can,
!> the forces from lists with a skin are compared at each step with sums over all pairs of points,
!> and over all points.
module test_force_search
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_contact, only: contact_type
  use pd_body_surface_distance, only: new_facets
  use pd_body_surface_fill, only: new_solid, solid_type
  use pd_body_surface_stl, only: read_stl_text
  use pd_force_obstacle, only: a_closed_surface, a_sphere, find_gap, obstacle_type, turned_at_most
  use pd_force_term, only: term_view_type
  use pd_force_touch, only: touch_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_motion_observer, only: instant_type, observer_type
  use pd_motion_system, only: system_type, view_of
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: set_up_type
  use comparisons, only: max_abs
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: expect, expect_true, noise, ready_alone, rotation_matrix
  use meshes, only: write_file
  use surfaces, only: binary_stl, box_facets
  use test_scene_expect, only: line
  implicit none (type, external)
  private
  public :: collect_force_search

  real(wp), parameter :: h = 1.0e-3_wp            !! spacing of all bodies [m]
  real(wp), parameter :: bulk = 1.0e9_wp/1.5_wp   !! E/(3 (1 - 2 nu)) [Pa]
  character(*), parameter :: block = '&scene dimension = 3 /'//line// &
    & '&material youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.25 /'//line// &
    & "&body name = 'block' lower = -4e-3, -4e-3, -3e-3 upper = 4e-3, 4e-3, 0 "// &
    & 'points = 8, 8, 3 /'//line

  !> Compares at each step.
  type, extends(observer_type) :: judge_type
    real(wp) :: listed = 1.0_wp   !! part of the skin up to which what was found stays in the lists
    integer :: searches = -1      !! at the last look at them
    integer :: steps = 0          !! compared
    integer :: touching = 0       !! of these with forces
    real(wp) :: off = 0.0_wp      !! largest deviation of a force over the largest force
  contains
    procedure :: observe
  end type judge_type

contains

  subroutine collect_force_search(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('points that come fast', test_points), &
      & new_unittest('pieces that come fast', test_pieces), &
      & new_unittest('rigid bodies that come fast', test_rigid), &
      & new_unittest('lists that end too early are found out', test_short), &
      & new_unittest('the bound of rotation', test_rotation)]
  end subroutine collect_force_search

  !> Forces of all terms, from their lists, and from sums over all pairs and points.
  subroutine observe(observer, system, instant, error)
    class(judge_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    type(instant_type), intent(in) :: instant
    type(fault_type), allocatable, intent(out) :: error
    type(term_view_type) :: view
    real(wp), allocatable :: force(:, :), known(:, :)
    real(wp) :: off
    integer :: t

    call view_of(system, instant%time, view)
    allocate (force(system%body%n_slots, 3), known(system%body%n_slots, 3), source=0.0_wp)
    call system%terms%add_force(view, force)
    do t = 1, system%terms%number()
      select type (term => system%terms%items(t)%term)
      type is (contact_type)
        call add_all_pairs(system, term, known)
      type is (touch_type)
        call add_all_points(system, term, known)
      class default
        continue
      end select
    end do
    if (observer%listed < 1.0_wp) call shorten(observer, system)
    observer%steps = observer%steps + 1
    if (max_abs(known) > 0.0_wp) observer%touching = observer%touching + 1
    if (.not. max_abs(force - known) <= 1.0e-11_wp*max_abs(known)) then
      off = max_abs(force - known)/max(max_abs(known), tiny(1.0_wp))
      ! one that is not a number counts, too
      observer%off = max(observer%off, merge(off, huge(off), off <= huge(off)))
    end if
    if (instant%step < 0) allocate (error)
  end subroutine observe

  !> After a search leave in its list only what is within a part of the skin, as a search with a
  !> skin that is too small would have it; the list is then used as long as before.
  subroutine shorten(observer, system)
    type(judge_type), intent(inout) :: observer
    type(system_type), intent(inout) :: system
    logical, allocatable :: stays(:)
    integer, allocatable :: start(:)
    real(wp) :: gap, normal(3)
    integer :: t, i, e, k, j

    associate (body => system%body, u => system%state%u)
      do t = 1, system%terms%number()
        select type (term => system%terms%items(t)%term)
        type is (contact_type)
          if (term%movement%searches == observer%searches) cycle
          observer%searches = term%movement%searches
          start = term%pairs%start
          allocate (stays(start(size(start)) - 1))
          do i = 1, size(term%pairs%slots)
            k = term%pairs%slots(i)
            do e = term%pairs%start(i), term%pairs%start(i + 1) - 1
              j = term%pairs%other(e)
              stays(e) = norm2(body%x(j, :) + u(j, :) - body%x(k, :) - u(k, :)) &
                & < 0.9_wp*h + observer%listed*term%skin
            end do
            start(i + 1) = start(i) + count(stays(term%pairs%start(i):term%pairs%start(i + 1) - 1))
          end do
          term%pairs%other = pack(term%pairs%other(:size(stays)), stays)
          term%pairs%start = start
          deallocate (stays)
        type is (touch_type)
          if (term%movement%searches == observer%searches) cycle
          observer%searches = term%movement%searches
          allocate (stays(size(term%near)))
          do i = 1, size(stays)
            k = term%slots(term%near(i))
            call find_gap(system%obstacles(term%obstacle), body%x(k, :) + u(k, :), gap, normal)
            stays(i) = gap < h/2 + observer%listed*term%skin
          end do
          term%near = pack(term%near, stays)
          deallocate (stays)
        class default
          continue
        end select
      end do
    end associate
  end subroutine shorten

  !> The force of all pairs that are closer than 0.9 spacings, or than at the start.
  subroutine add_all_pairs(system, contact, force)
    type(system_type), intent(in) :: system
    type(contact_type), intent(in) :: contact
    real(wp), intent(inout) :: force(:, :)
    type(bonds_type) :: bonds
    real(wp) :: r(3), d, begins, stiffness
    integer :: k, j

    call allocate_bonds(system%family, bonds)
    associate (body => system%body, u => system%state%u)
      ! 18 K/(pi delta^4), the density of a pair's force per volume of the other point
      stiffness = contact%law%rule%stiffness*18*bulk &
        & /(acos(-1.0_wp)*system%family%rule%delta**5)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        call system%family%bonds_of(k, bonds)
        do j = 1, body%n_slots
          if (body%point(j) == 0 .or. j == k) cycle
          r = body%x(j, :) - body%x(k, :)
          begins = min(0.9_wp*h, norm2(r))
          r = r + u(j, :) - u(k, :)
          d = norm2(r)
          if (d >= begins) cycle
          if (contact%law%rule%pieces) then
            if (any(bonds%j(:bonds%n) == j .and. bonds%intact(:bonds%n))) cycle
          else
            if (body%body(k) == body%body(j)) cycle
          end if
          force(k, :) = force(k, :) - stiffness*body%volume(j)*(begins - d)*r/d
        end do
      end do
    end associate
  end subroutine add_all_pairs

  !> The force on all points that are nearer to a surface than half a spacing.
  subroutine add_all_points(system, touch, force)
    type(system_type), intent(in) :: system
    type(touch_type), intent(in) :: touch
    real(wp), intent(inout) :: force(:, :)
    real(wp) :: gap, normal(3)
    integer :: k

    associate (body => system%body, u => system%state%u)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        call find_gap(system%obstacles(touch%obstacle), body%x(k, :) + u(k, :), gap, normal)
        if (gap >= h/2) cycle
        force(k, :) = force(k, :) + touch%rule%stiffness*12*bulk/system%family%rule%delta**2 &
          & *(h/2 - gap)*normal
      end do
    end associate
  end subroutine add_all_points

  !> Run a scene, compare at each of its steps; the number of searches that it took. With `listed`
  !> lists end too early, and forces must be off.
  subroutine judge(text, searches, error, listed)
    character(*), intent(in) :: text
    integer, intent(out) :: searches
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in), optional :: listed
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(judge_type) :: observer
    type(fault_type), allocatable :: fault
    integer :: t

    searches = 0
    if (allocated(error)) return
    call read_scene_text(text, 'build/search.nml', scene, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    if (present(listed)) observer%listed = listed
    call ready_alone(scene, set_up, error)
    if (allocated(error)) return
    call run_explicit(set_up%system, trim(scene%time%integrator), set_up%plan%step, &
      & set_up%plan%steps, observer, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    call expect_true(error, observer%steps > set_up%plan%steps, 'steps are missing')
    call expect_true(error, observer%touching > 3, 'they hardly touch')
    if (present(listed)) then
      call expect_true(error, observer%off > 1.0e-3_wp, 'what a search misses is not seen')
    else
      call expect(error, observer%off, 0.0_wp, 0.0_wp, 'forces')
    end if
    do t = 1, set_up%system%terms%number()
      select type (term => set_up%system%terms%items(t)%term)
      type is (contact_type)
        searches = term%movement%searches
      type is (touch_type)
        searches = term%movement%searches
      class default
        continue
      end select
    end do
  end subroutine judge

  !> A small body flies into the block at 50, 400 and 1500 m/s; the fastest goes by more than half a
  !> skin in each step, so that each needs a search, the slowest by a twentieth of it.
  subroutine test_points(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: speeds(3) = [character(4) :: '50', '400', '1500']
    character(*), parameter :: integrators(3) = [character(16) :: 'forward_backward', &
      & 'velocity_verlet', 'runge_kutta']
    integer :: searches, i

    do i = 1, 3
      call judge(block//"&body name = 'shot' lower = -1e-3, -1e-3, 1e-3 upper = 1e-3, 1e-3, 3e-3 " &
        & //'points = 2, 2, 2 /'//line//"&region name = 'shot' where = 'z > 0.5e-3' /"//line// &
        & "&initial region = 'shot' velocity_z = -"//trim(speeds(i))//" velocity_x = 30 /"//line// &
        & "&contact between = 'block', 'shot' normals = 'centres' /"//line// &
        & "&time integrator = '"//trim(integrators(i))//"' steps = "// &
        & trim(merge('150', '60 ', i == 1))//' /', searches, error)
      if (i == 1) call expect_true(error, searches > 2 .and. searches < 75, 'searches')
      if (i == 3) call expect_true(error, searches > 30, 'it was searched too seldom')
      if (allocated(error)) return
    end do
  end subroutine test_points

  !> The block, cut at half its length, whose halves meet at 40 and 600 m/s.
  subroutine test_pieces(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: speeds(2) = [character(3) :: '40', '600']
    integer :: searches, i

    do i = 1, 2
      call judge(block//'&crack corner = 0, -1, -1 edge_1 = 0, 2, 0 edge_2 = 0, 0, 2 /'//line// &
        & "&region name = 'right' where = 'x > 0' /"//line// &
        & "&initial region = 'right' velocity_x = -"//trim(speeds(i))//' velocity_y = 25 /'// &
        & line//"&contact within = 'block' stiffness = 3 /"//line//'&time steps = 60 /', searches, &
        & error)
      if (i == 1) call expect_true(error, searches > 2 .and. searches < 50, 'searches')
      if (allocated(error)) return
    end do
  end subroutine test_pieces

  !> A sphere, a box, a cylinder and a closed surface that turn, and a half-space that moves.
  subroutine test_rigid(error)
    type(error_type), allocatable, intent(out) :: error
    character(170), allocatable :: bodies(:)
    integer :: searches, i

    call rigid_bodies(bodies)
    do i = 1, size(bodies)
      call judge(with_tool(bodies(i)), searches, error)
      if (i /= 2) call expect_true(error, searches > 1 .and. searches < 40, 'searches')
      if (i == 2) call expect_true(error, searches > 20, 'it was searched too seldom')
      if (allocated(error)) then
        error%message = error%message//': '//trim(bodies(i))
        return
      end if
    end do
  end subroutine test_rigid

  !> The rigid bodies, which come fast.
  subroutine rigid_bodies(bodies)
    character(170), allocatable, intent(out) :: bodies(:)

    call write_file('search.stl', binary_stl(box_facets([-3.0_wp, -0.5_wp, -0.5_wp], [3.0_wp, &
      & 0.5_wp, 0.5_wp])))
    bodies = [character(170) :: &
      & "shape = 'sphere' centre = 0, 0, 2.1e-3 radius = 2e-3 mass = 1e-4 velocity_z = -60", &
      & "shape = 'sphere' centre = 0, 0, 2.1e-3 radius = 2e-3 mass = 1e-4 velocity_z = -1500", &
      & "shape = 'box' centre = 0, 0, 4e-3 edges = 6e-3, 1e-3, 1e-3 mass = 1e-4 "// &
      & 'velocity_z = -60 spin_y = 9e4 spin_x = 2e4', &
      & "shape = 'cylinder' centre = 0, 0, 2.5e-3 radius = 1e-3 length = 6e-3 axis = 1, 0, 0 "// &
      & 'mass = 1e-4 velocity_z = -60 spin_y = 5e4 spin_x = 4e5', &
      & "shape = 'surface' centre = 0, 0, 4e-3 surface = 'search.stl' scale = 1e-3 mass = 1e-4 "// &
      & 'velocity_z = -60 spin_y = 9e4 spin_x = 2e4', &
      & "shape = 'half_space' centre = 0, 0, -5e-3 normal = 0, 0, 1 displacement_z = '60*t' "// &
      & "rotation = 'imposed' spin_y = 4e4"]
  end subroutine rigid_bodies

  !> The block and a tool that hits it.
  function with_tool(tool) result(text)
    character(*), intent(in) :: tool
    character(:), allocatable :: text

    text = block//"&rigid name = 'tool' "//trim(tool)//' /'//line// &
      & "&contact between = 'block', 'tool' /"//line//'&time duration = 4e-5 /'
  end function with_tool

  !> Lists without the skin miss points: the comparison sees it for points and for each rigid body.
  !> (A sphere at 1500 m/s is searched in nearly every step.)
  subroutine test_short(error)
    type(error_type), allocatable, intent(out) :: error
    character(170), allocatable :: bodies(:)
    integer :: searches, i

    call judge(block//"&body name = 'shot' lower = -1e-3, -1e-3, 1e-3 upper = 1e-3, 1e-3, 3e-3 "// &
      & 'points = 2, 2, 2 /'//line//"&region name = 'shot' where = 'z > 0.5e-3' /"//line// &
      & "&initial region = 'shot' velocity_z = -50 velocity_x = 30 /"//line// &
      & "&contact between = 'block', 'shot' normals = 'centres' /"//line// &
      & '&time steps = 150 /', searches, error, listed=0.0_wp)
    call rigid_bodies(bodies)
    do i = 1, size(bodies)
      if (i == 2) cycle
      call judge(with_tool(bodies(i)), searches, error, listed=0.0_wp)
      if (allocated(error)) then
        error%message = error%message//': '//trim(bodies(i))
        return
      end if
    end do
  end subroutine test_short

  !> At places and rotations at random the distance from the surface changes by no more than the
  !> bound, and now and then by half of it.
  subroutine test_rotation(error)
    type(error_type), allocatable, intent(out) :: error
    type(obstacle_type) :: before, now
    real(wp) :: y(3), axis(3), gap, gap_before, normal(3), change, bound
    type(solid_type) :: solid
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text
    integer :: shape, state, i, c, tight

    text = binary_stl(box_facets([-0.75_wp, -0.75_wp, -1.5_wp], [0.75_wp, 0.75_wp, 1.5_wp]))
    call read_stl_text(text, 'part.stl', 1.0_wp, solid%surface, fault)
    if (.not. allocated(fault)) call new_solid(solid, fault)
    allocate (before%facets)
    if (.not. allocated(fault)) call new_facets(solid%surface, 0, before%facets, fault)
    call expect_true(error, .not. allocated(fault), 'the facets of a box')
    if (allocated(error)) return
    state = 3
    do shape = a_sphere, a_closed_surface
      tight = 0
      do i = 1, 2000
        before%shape = shape
        before%half = [0.7_wp, 0.7_wp, 1.6_wp]
        if (shape == a_closed_surface) before%half = [before%facets%reach, 0.0_wp, 0.0_wp]
        axis = [(noise(state), c=1, 3)]
        before%frame = rotation_matrix(axis/norm2(axis), 3*noise(state))
        now = before
        axis = [(noise(state), c=1, 3)]
        now%frame = matmul(rotation_matrix(axis/norm2(axis), 0.5_wp*noise(state)), before%frame)
        y = 2.0_wp*[(noise(state), c=1, 3)]
        call find_gap(before, y, gap_before, normal)
        call find_gap(now, y, gap, normal)
        change = abs(gap - gap_before)
        bound = turned_at_most(before, now, max(gap, 0.0_wp), norm2(y))
        call expect_true(error, change <= bound + 1.0e-14_wp, 'the distance changes by more')
        if (change > bound/2 .and. bound > 1.0e-3_wp) tight = tight + 1
        if (allocated(error)) return
      end do
      if (shape /= a_sphere) call expect_true(error, tight > 20, 'the bound is far too high')
    end do
  end subroutine test_rotation

end module test_force_search
