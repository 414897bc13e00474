!> Rigid bodies that are closed surfaces from files: distances, normals, mass and motion against
!> those of boxes, spheres and tori, and what is refused.
module test_force_closed
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_body_mesh_near, only: distance
  use pd_body_surface_distance, only: area_around, facet_gap, facets_type, new_facets
  use pd_body_surface_fill, only: new_solid, solid_type
  use pd_body_surface_moments, only: surface_moments
  use pd_body_surface_stl, only: read_stl_text
  use pd_force_obstacle, only: a_box, a_closed_surface, a_sphere, find_gap, obstacle_type, &
    & surface_of
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use bodies, only: diary_type, expect, expect_true, noise, ready_alone, rotation_matrix
  use comparisons, only: expect_close
  use meshes, only: write_file
  use surfaces, only: ascii_stl, ball_facets, binary_stl, box_facets, joined, prism_facets, &
    & reversed, torus_facets, turned
  use test_scene_expect, only: expect_parts, line
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  implicit none (type, external)
  private
  public :: collect_force_closed

  real(wp), parameter :: pi = acos(-1.0_wp)
  !> A block of 8 x 8 x 4 points of 1 mm below z = 0.
  character(*), parameter :: block = '&scene dimension = 3 /'//line// &
    & '&material youngs_modulus = 1e9 density = 1e3 poissons_ratio = 0.25 /'//line// &
    & "&body name = 'block' lower = -4e-3, -4e-3, -4e-3 upper = 4e-3, 4e-3, 0 "// &
    & 'points = 8, 8, 4 /'//line
  character(*), parameter :: touches = line//"&contact between = 'block', 'tool' friction = 0.3 /" &
    & //line

contains

  subroutine collect_force_closed(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the distance from a box', test_box), &
      & new_unittest('the distance from balls and tori', test_round), &
      & new_unittest('the distance from all facets', test_all_facets), &
      & new_unittest('solids that touch, and facets without area', test_odd), &
      & new_unittest('volume, centre and inertia', test_moments), &
      & new_unittest('where a scene puts it', test_scene), &
      & new_unittest('it hits as a box does', test_hits), &
      & new_unittest('what is refused', test_refused)]
  end subroutine collect_force_closed

  !> Facets that are ready for distances.
  subroutine facets_of(x, facets, error, fault)
    real(wp), intent(in) :: x(:, :, :)
    type(facets_type), intent(out) :: facets
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(out), optional :: fault
    type(solid_type) :: solid
    type(fault_type), allocatable :: found
    character(:), allocatable :: text

    text = binary_stl(x)
    call read_stl_text(text, 'part.stl', 1.0_wp, solid%surface, found)
    if (.not. allocated(found)) call new_solid(solid, found)
    if (.not. allocated(found)) call new_facets(solid%surface, solid%edges%n_many, facets, found)
    if (present(fault)) then
      if (allocated(found)) call move_alloc(found, fault)
    else if (allocated(found)) then
      call test_failed(error, found%message)
    end if
  end subroutine facets_of

  !> Outside and inside, moved and turned: distance and normal are those of the shape.
  subroutine test_box(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: half(3) = [1.0_wp, 0.75_wp, 1.5_wp]
    type(obstacle_type) :: closed, known
    real(wp) :: y(3), gap, normal(3), known_gap, known_normal(3)
    integer :: state, i, c, kinds(4)

    allocate (closed%facets)
    call facets_of(box_facets(-half, half), closed%facets, error)
    if (allocated(error)) return
    closed%shape = a_closed_surface
    closed%half = [norm2(half), 0.0_wp, 0.0_wp]
    closed%centre = [0.3_wp, -0.2_wp, 0.5_wp]
    closed%frame = rotation_matrix([0.6_wp, 0.0_wp, 0.8_wp], 0.7_wp)
    known%shape = a_box
    known%half = half
    known%centre = closed%centre
    known%frame = closed%frame
    call expect(error, closed%facets%reach, norm2(half), 1.0e-15_wp, 'reach')
    do i = 0, 2
      call expect(error, surface_of(closed, 0.1_wp*i), 8*(half(1)*half(2) + half(2)*half(3) &
        & + half(3)*half(1)) + 0.1_wp*i*4*pi*sum(half) + (0.1_wp*i)**2*4*pi, 1.0e-12_wp, &
        & 'the area around it')
    end do
    state = 11
    kinds = 0
    do i = 1, 4000
      y = closed%centre + 2.5_wp*[(noise(state), c=1, 3)]
      call find_gap(closed, y, gap, normal)
      call find_gap(known, y, known_gap, known_normal)
      call expect(error, gap, known_gap, 1.0e-13_wp, 'distance')
      call expect_close(error, normal, known_normal, 1.0e-12_wp, 'normal')
      if (gap < 0.0_wp) then
        kinds(4) = kinds(4) + 1
      else
        c = count(abs(matmul(normal, closed%frame)) > 1.0e-6_wp)
        kinds(c) = kinds(c) + 1
      end if
      if (allocated(error)) return
    end do
    call expect_true(error, all(kinds > 100), 'faces, edges, corners or the inside are missing')
  end subroutine test_box

  !> Balls and tori of many facets: the distance is that of the round body within the depth of the
  !> facets, and the sign is that of the inside beyond it.
  subroutine test_round(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: large = 1.0_wp, small = 0.4_wp
    type(facets_type) :: ball, torus
    type(obstacle_type) :: sphere
    real(wp) :: y(3), gap, normal(3), known, known_normal(3), ring(3), depth
    integer :: state, i, c

    call facets_of(ball_facets(1.0_wp, 40), ball, error)
    call facets_of(torus_facets(large, small, 80, 32), torus, error)
    if (allocated(error)) return
    sphere%half = 1.0_wp
    state = 7
    do i = 1, 2000
      y = 1.7_wp*[(noise(state), c=1, 3)]
      call facet_gap(ball, y, gap, normal)
      call find_gap(sphere, y, known, known_normal)
      ! half a facet is seen from the centre in pi/80 along both directions
      depth = 1 - cos(pi/80)**2
      call expect(error, gap, known + depth/2, 0.51_wp*depth, 'ball')
      ! a facet's plane is off by the angle to its corners at most; within the body the place is
      ! nearer to the axis than its foot
      if (abs(known) < 0.5_wp) call expect_true(error, dot_product(normal, known_normal) &
        & > cos(2*sqrt(2.0_wp)*pi/80), 'normal of the ball')
      y(3) = y(3)/2
      call facet_gap(torus, y, gap, normal)
      ring = [y(1), y(2), 0.0_wp]/norm2(y(:2))*large
      known = norm2(y - ring) - small
      depth = (large + small)*(1 - cos(pi/80)) + small*(1 - cos(pi/32))
      call expect(error, gap, known, depth, 'torus')
      if (allocated(error)) return
    end do
    call expect(error, area_around(ball, 0.5_wp), 4*pi*1.5_wp**2, 0.01_wp*4*pi*1.5_wp**2, &
      & 'the area around the ball')
  end subroutine test_round

  !> The tree finds the nearest of all facets, and the place at the distance along the normal is on
  !> the surface.
  subroutine test_all_facets(error)
    type(error_type), allocatable, intent(out) :: error
    type(facets_type) :: facets
    real(wp), allocatable :: x(:, :, :)
    real(wp) :: y(3), gap, normal(3), known, again, turned_normal(3)
    integer :: state, i, c, f

    x = joined(turned(torus_facets(1.0_wp, 0.4_wp, 17, 9)), prism_facets(0.5_wp, 3.0_wp, 7) + 4)
    x = joined(x, reversed(box_facets([3.75_wp, 3.75_wp, 5.0_wp], [4.25_wp, 4.25_wp, 6.0_wp])))
    x = joined(x, box_facets([3.9375_wp, 3.9375_wp, 5.25_wp], [4.0625_wp, 4.0625_wp, 5.75_wp]))
    call facets_of(x, facets, error)
    if (allocated(error)) return
    state = 23
    do i = 1, 1500
      y = [(merge(2.0_wp, 5.0_wp, mod(i, 3) > 0) + merge(4.0_wp, 1.5_wp, mod(i, 3) > 0) &
        & *noise(state), c=1, 3)]
      if (mod(i, 4) == 0) y = [4.0_wp, 4.0_wp, 5.5_wp] + 0.6_wp*[(noise(state), c=1, 3)]
      call facet_gap(facets, y, gap, normal)
      known = huge(known)
      do f = 1, facets%surface%n_facets
        known = min(known, distance(y, facets%surface%x(:, facets%surface%corner(:, f))))
      end do
      call expect(error, abs(gap), known, 1.0e-13_wp, 'distance')
      call expect(error, norm2(normal), 1.0_wp, 1.0e-14_wp, 'length of the normal')
      call facet_gap(facets, y - (gap + 1.0e-9_wp)*normal, again, turned_normal)
      call expect_true(error, again < 0.0_wp .and. again > -2.0e-9_wp, 'foot, within')
      call facet_gap(facets, y - (gap - 1.0e-9_wp)*normal, again, turned_normal)
      call expect_true(error, again > 0.0_wp .and. again < 2.0e-9_wp, 'foot, outside')
      if (allocated(error)) return
    end do
    ! at a corner and on an edge there is a normal, too
    call facet_gap(facets, [4.25_wp, 4.25_wp, 6.0_wp], gap, normal)
    call expect(error, gap, 0.0_wp, 1.0e-15_wp, 'corner')
    call expect_close(error, normal, -sqrt(1.0_wp/3), 1.0e-12_wp, 'normal at the corner')
    call facet_gap(facets, [4.25_wp, 4.25_wp, 5.5_wp], gap, normal)
    call expect_close(error, normal, [-sqrt(0.5_wp), -sqrt(0.5_wp), 0.0_wp], 1.0e-12_wp, &
      & 'normal at the edge')
  end subroutine test_all_facets

  !> Two boxes with a common edge, where four facets meet; and a box one of whose sides has an edge
  !> more, which facets without area close.
  subroutine test_odd(error)
    type(error_type), allocatable, intent(out) :: error
    type(facets_type) :: two, odd, plain
    type(obstacle_type) :: box
    real(wp), allocatable :: x(:, :, :)
    real(wp) :: y(3), gap, normal(3), known, other, ignored(3), middle(3)
    integer :: state, i, c, f, k

    x = joined(box_facets([-1.0_wp, -1.0_wp, -1.0_wp], [0.0_wp, 0.0_wp, 1.0_wp]), &
      & box_facets([0.0_wp, 0.0_wp, -1.0_wp], [1.0_wp, 1.0_wp, 1.0_wp]))
    call facets_of(x, two, error)
    if (allocated(error)) return
    box%shape = a_box
    box%half = [0.5_wp, 0.5_wp, 1.0_wp]
    state = 3
    do i = 1, 1000
      y = 1.5_wp*[(noise(state), c=1, 3)]
      call facet_gap(two, y, gap, normal)
      box%centre = [-0.5_wp, -0.5_wp, 0.0_wp]
      call find_gap(box, y, known, ignored)
      box%centre = [0.5_wp, 0.5_wp, 0.0_wp]
      call find_gap(box, y, other, ignored)
      call expect(error, gap, min(known, other), 1.0e-13_wp, 'two boxes')
      if (allocated(error)) return
    end do
    ! the edge between the triangles of the first side has a middle for one of them
    x = box_facets([-1.0_wp, -1.0_wp, -1.0_wp], [1.0_wp, 1.0_wp, 1.0_wp])
    call facets_of(x, plain, error)
    do k = 1, 3
      f = k
      if (is_common(x(:, k, 1)) .and. is_common(x(:, mod(k, 3) + 1, 1))) exit
    end do
    middle = (x(:, f, 1) + x(:, mod(f, 3) + 1, 1))/2
    x = joined(x, x(:, :, [1, 1]))
    x(:, mod(f, 3) + 1, 1) = middle
    x(:, f, size(x, 3) - 1) = middle
    ! corner, middle, corner: without area
    x(:, :, size(x, 3)) = reshape([x(:, f, size(x, 3)), x(:, mod(f, 3) + 1, size(x, 3)), middle], &
      & [3, 3])
    call facets_of(x, odd, error)
    if (allocated(error)) return
    call expect_true(error, odd%surface%n_flat > 0, 'no facet without area')
    do i = 1, 1000
      y = 1.5_wp*[(noise(state), c=1, 3)]
      call facet_gap(odd, y, gap, normal)
      call facet_gap(plain, y, known, ignored)
      call expect(error, gap, known, 1.0e-13_wp, 'a box with a flat facet')
      call expect_close(error, normal, ignored, 1.0e-12_wp, 'its normal')
      if (allocated(error)) return
    end do

  contains

    !> Whether a corner is one of the second triangle.
    logical function is_common(corner)
      real(wp), intent(in) :: corner(3)
      integer :: n

      is_common = any([(all(abs(corner - x(:, n, 2)) <= 0.0_wp), n=1, 3)])
    end function is_common
  end subroutine test_odd

  !> Of a box in any place, a prism, and a ball of more and more facets, whose error is of second
  !> order.
  subroutine test_moments(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: edges(3) = [1.0_wp, 0.5_wp, 2.0_wp]
    type(facets_type) :: facets
    real(wp) :: volume, centre(3), inertia(3, 3), known(3, 3), turn(3, 3), x(3, 3, 1), off(2)
    integer :: i, c, n

    call facets_of(turned(box_facets([0.0_wp, 0.0_wp, 0.0_wp], edges)), facets, error)
    if (allocated(error)) return
    call surface_moments(facets%surface, volume, centre, inertia)
    ! numbers of single precision
    call expect(error, volume, 1.0_wp, 2.0e-6_wp, 'volume')
    x(:, :, 1) = spread(edges/2, 2, 3)
    x = turned(x)
    call expect_close(error, centre, x(:, 1, 1), 1.0e-6_wp, 'centre')
    x(:, :, 1) = 0.0_wp
    do c = 1, 3
      x(c, c, 1) = 1.0_wp
    end do
    x = turned(x) - 0.3_wp
    turn = x(:, :, 1)
    known = 0.0_wp
    do c = 1, 3
      known(c, c) = (sum(edges**2) - edges(c)**2)/12
    end do
    known = matmul(turn, matmul(known, transpose(turn)))
    call expect_close(error, inertia, known, 2.0e-6_wp, 'inertia')
    call facets_of(box_facets([4.0_wp, 5.0_wp, 6.0_wp], [5.0_wp, 5.5_wp, 8.0_wp]), facets, error)
    if (allocated(error)) return
    call surface_moments(facets%surface, volume, centre, inertia)
    known = 0.0_wp
    do c = 1, 3
      known(c, c) = (sum(edges**2) - edges(c)**2)/12
    end do
    call expect(error, volume, 1.0_wp, 1.0e-14_wp, 'volume, exact numbers')
    call expect_close(error, centre, [4.5_wp, 5.25_wp, 7.0_wp], 1.0e-14_wp, 'centre, exact')
    call expect_close(error, inertia, known, 1.0e-14_wp, 'inertia, exact')
    do i = 1, 2
      n = 20*i
      call facets_of(ball_facets(1.0_wp, n), facets, error)
      if (allocated(error)) return
      call surface_moments(facets%surface, volume, centre, inertia)
      off(i) = 1 - inertia(3, 3)/(8*pi/15)
      call expect_close(error, centre, 0.0_wp, 1.0e-7_wp, 'centre of a ball')
    end do
    call expect_true(error, off(2) > 0.0_wp .and. off(2) < 0.02_wp, 'inertia of a ball')
    call expect(error, off(1)/off(2), 4.0_wp, 0.1_wp, 'its order')
  end subroutine test_moments

  !> Mass, centre, principal moments and axes of a box in a file, in another unit, turned and moved,
  !> are those of shape = 'box'.
  subroutine test_scene(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: closed, box
    real(wp) :: spin(3)

    call write_file('tool.stl', ascii_stl(box_facets([4.0_wp, 5.0_wp, 8.0_wp], [7.0_wp, 9.0_wp, &
      & 10.0_wp]), 'tool'))
    call prepared(block//"&rigid name = 'tool' shape = 'surface' surface = 'tool.stl' "// &
      & 'scale = 1e-3 density = 7000 /'//touches//'&time steps = 1 /', closed, error)
    call prepared(block//"&rigid name = 'tool' shape = 'box' edges = 3e-3, 4e-3, 2e-3 "// &
      & 'centre = 5.5e-3, 7e-3, 9e-3 density = 7000 /'//touches//'&time steps = 1 /', box, error)
    if (allocated(error)) return
    call compare('as in the file')
    call prepared(block//"&rigid name = 'tool' shape = 'surface' surface = 'tool.stl' "// &
      & 'scale = 1e-3 mass = 0.25 axis = 1, 2, 0.5 angle = 25 centre = 1e-3, 2e-3, 9e-3 '// &
      & 'spin_x = 30 spin_y = -50 /'//touches//'&time steps = 1 /', closed, error)
    call prepared(block//"&rigid name = 'tool' shape = 'box' edges = 3e-3, 4e-3, 2e-3 "// &
      & 'centre = 1e-3, 2e-3, 9e-3 mass = 0.25 axis = 1, 2, 0.5 angle = 25 '// &
      & 'spin_x = 30 spin_y = -50 /'//touches//'&time steps = 1 /', box, error)
    if (allocated(error)) return
    call compare('turned and moved')
    ! principal moments along x, y, z of the file
    call prepared(block//"&rigid name = 'tool' shape = 'surface' surface = 'tool.stl' "// &
      & 'scale = 1e-3 mass = 0.25 angle = 90 inertia = 1e-6, 2e-6, 2.5e-6 spin_x = 30 /'// &
      & touches//'&time steps = 1 /', closed, error)
    if (allocated(error)) return
    spin = closed%system%rigid_bodies(1)%pose%momentum
    call expect_close(error, spin, [2.0e-6_wp*30, 0.0_wp, 0.0_wp], 1.0e-18_wp, 'given inertia')

  contains

    subroutine compare(what)
      character(*), intent(in) :: what

      associate (a => closed%system%rigid_bodies(1)%pose, b => box%system%rigid_bodies(1)%pose)
        call expect(error, a%mass, b%mass, 1.0e-14_wp*b%mass, what//', mass')
        call expect_close(error, a%centre, b%centre, 1.0e-16_wp, what//', centre')
        call expect_close(error, a%spread, b%spread, 1.0e-13_wp*b%mass*1.0e-5_wp, what// &
          & ', inertia')
        call expect_close(error, a%momentum, b%momentum, 1.0e-13_wp*b%mass*1.0e-5_wp*50, what// &
          & ', angular momentum')
      end associate
      associate (a => closed%system%obstacles(1), b => box%system%obstacles(1))
        call expect(error, a%per_mass, b%per_mass, 1.0e-13_wp*b%per_mass, what//', mobility')
        call expect(error, a%per_inertia, b%per_inertia, 1.0e-12_wp*b%per_inertia, what// &
          & ', mobility of rotation')
      end associate
    end subroutine compare
  end subroutine test_scene

  !> A scene, ready for its first step.
  subroutine prepared(text, set_up, error)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call read_scene_text(text, 'build/tool.nml', scene, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    call ready_alone(scene, set_up, error)
  end subroutine prepared

  !> A light box in a file that spins and hits the block with an edge, with friction, does what
  !> shape = 'box' does; the energies balance. And an elastic block comes back from it.
  subroutine test_hits(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: ways = ' axis = 1, 2, 0.5 angle = 25 centre = 0.3e-3, 0.5e-3, '// &
      & '3e-3 density = 7800 velocity_z = -30 spin_y = 4000 /'//touches// &
      & '&time duration = 8e-5 step = 2e-8 /'
    character(*), parameter :: floor = line//"&initial velocity_z = -5 /"//line//"&contact "// &
      & "between = 'block', 'tool' /"//line//'&time duration = 6e-5 step = 1e-7 /'
    type(set_up_type) :: closed, box
    type(diary_type) :: diary

    call write_file('tool.stl', binary_stl(box_facets([-1.5_wp, -2.0_wp, -1.0_wp], [1.5_wp, &
      & 2.0_wp, 1.0_wp])))
    call ran(block//"&rigid name = 'tool' shape = 'surface' surface = 'tool.stl' scale = 1e-3"// &
      & ways, closed, diary, error)
    if (allocated(error)) return
    associate (n => diary%n)
      call expect(error, diary%kinetic(n) + diary%strain(n) + diary%dissipated(n) &
        & - diary%work(n), diary%kinetic(1), 1.0e-3_wp*diary%kinetic(1), 'energy')
      call expect_true(error, diary%dissipated(n) > 1.0e-3_wp*diary%kinetic(1), 'no friction')
    end associate
    call ran(block//"&rigid name = 'tool' shape = 'box' edges = 3e-3, 4e-3, 2e-3"//ways, box, &
      & diary, error)
    if (allocated(error)) return
    associate (a => closed%system%rigid_bodies(1)%pose, b => box%system%rigid_bodies(1)%pose)
      call expect_true(error, b%velocity(3) > -25.0_wp, 'it is hardly slower')
      call expect_close(error, a%velocity, b%velocity, 1.0e-9_wp*30, 'velocity')
      call expect_close(error, a%momentum, b%momentum, 1.0e-9_wp*norm2(b%momentum), &
        & 'angular momentum')
      call expect_close(error, closed%system%state%v, box%system%state%v, 1.0e-9_wp*30, 'points')
    end associate
    call ran(block//"&rigid name = 'tool' shape = 'surface' surface = 'tool.stl' scale = 0.01 "// &
      & "displacement_x = 0 displacement_y = 0 displacement_z = 0 rotation = 'held' "// &
      & 'centre = 0, 0, -0.014 /'//floor, closed, diary, error)
    if (allocated(error)) return
    call expect_close(error, diary%kinetic + diary%strain, diary%kinetic(1), &
      & 0.01_wp*diary%kinetic(1), 'energy of the block')
    call expect_true(error, sum(closed%system%state%v(:, 3), mask=closed%system%body%point > 0) &
      & > 0.5_wp*5*256, 'it does not come back')
    call ran(block//"&rigid name = 'tool' shape = 'box' edges = 0.03, 0.04, 0.02 "// &
      & "displacement_x = 0 displacement_y = 0 displacement_z = 0 rotation = 'held' "// &
      & 'centre = 0, 0, -0.014 /'//floor, box, diary, error)
    if (allocated(error)) return
    call expect_close(error, closed%system%state%v, box%system%state%v, 1.0e-9_wp*5, &
      & 'points that bounce')
  end subroutine test_hits

  !> Run a scene to its end.
  subroutine ran(text, set_up, diary, error)
    character(*), intent(in) :: text
    type(set_up_type), intent(out) :: set_up
    type(diary_type), intent(out) :: diary
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call prepared(text, set_up, error)
    if (allocated(error)) return
    call run_explicit(set_up%system, 'forward_backward', set_up%plan%step, set_up%plan%steps, &
      & diary, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine ran

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: tool = "&rigid name = 'tool' shape = 'surface' "
    character(*), parameter :: rest = touches//'&time steps = 1 /'
    character(*), parameter :: file = "surface = 'tool.stl' density = 1 "
    real(wp), allocatable :: x(:, :, :)
    integer :: f

    x = box_facets([-1.0_wp, -1.0_wp, 1.0_wp], [1.0_wp, 1.0_wp, 2.0_wp])
    call write_file('tool.stl', ascii_stl(x, 'tool'))
    call refused('&scene dimension = 2 /'//line//'&material youngs_modulus = 1e9 density = 1e3 '// &
      & 'poissons_ratio = 0.25 /'//line//"&body name = 'block' lower = 0, 0 upper = 1, 1 "// &
      & 'points = 9, 9 /'//line//tool//file// &
      & '/'//rest, 'surface in 2D')
    call refused(block//tool//'density = 1 /'//rest, "lacks the key 'surface'")
    call refused(block//tool//"surface = 'no.stl' density = 1 /"//rest, 'no.stl')
    call refused(block//tool//file//'radius = 1 /'//rest, "'radius' of a surface")
    call refused(block//"&rigid name = 'tool' shape = 'sphere' centre = 0, 0, 3 radius = 1 "// &
      & file//'/'//rest, "'surface' of a sphere")
    call refused(block//tool//"surface = 'tool.stl' /"//rest, "'mass' or 'density'")
    call refused(block//tool//file//'centre = 0, 0, -0.5e-3 scale = 1e-3 /'//rest, &
      & 'tool|within|start')
    call write_file('tool.stl', ascii_stl(x(:, :, [1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 12]), 'tool'))
    call refused(block//tool//file//'/'//rest, 'closed|3 edges|tool.stl:')
    call write_file('tool.stl', ascii_stl(reversed(x), 'tool'))
    call refused(block//tool//file//'/'//rest, 'inside out|tool.stl:2')
    call write_file('tool.stl', binary_stl(joined(x, x + 0.5_wp)))
    call refused(block//tool//file//'/'//rest, 'outside before it|tool.stl, facet')
    f = size(x, 3)
    call write_file('tool.stl', binary_stl(joined(x, x/4 + 1.125_wp)))
    call refused(block//tool//file//'/'//rest, 'outside before it|tool.stl, facet')
    call expect_true(error, f == 12, 'facets of a box')

  contains

    !> Reading or preparing a scene fails with these parts in the message.
    subroutine refused(text, parts)
      character(*), intent(in) :: text, parts
      type(scene_type) :: scene
      type(set_up_type) :: set_up
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call read_scene_text(text, 'build/tool.nml', scene, fault)
      if (.not. allocated(fault)) call prepare(scene, set_up, fault)
      call expect_parts(error, fault, parts)
    end subroutine refused
  end subroutine test_refused

end module test_force_closed
