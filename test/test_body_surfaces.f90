!> Surfaces: reading, what is inside, parts of cut cells, loads on facets, and what is refused.
module test_body_surfaces
  use omp_lib, only: omp_get_max_threads, omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body
  use pd_body_regions, only: in_region
  use pd_body_surface_crossing, only: crossings_type, find_crossings
  use pd_body_surface_fill, only: fill_cells, gaps_text, new_solid, points_inside, solid_type
  use pd_body_surface_shares, only: share_facets
  use pd_body_surface_stl, only: read_stl_text
  use pd_body_surface_surface, only: surface_type
  use pd_body_surface_winding, only: new_tree, tree_type, winding_number
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_motion_loads, only: load_of, load_type
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use meshes, only: write_file
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: expect, expect_true
  use comparisons, only: expect_close
  use surfaces, only: ascii_stl, ball_facets, binary_stl, box_facets, joined, prism_facets, &
    & reversed, torus_facets, turned
  use test_scene_expect, only: expect_parts
  implicit none (type, external)
  private
  public :: collect_body_surfaces

  character(1), parameter :: lf = achar(10)
  real(wp), parameter :: pi = acos(-1.0_wp)
  character(*), parameter :: steel = "&material name = 'steel' youngs_modulus = 2e11 "// &
    & 'poissons_ratio = 0.25 density = 7850 /'//lf//'&time steps = 1 /'//lf

contains

  subroutine collect_body_surfaces(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('cells of a box, with edges of facets through their centres', test_box), &
      & new_unittest('volume, centre and inertia of a turned box', test_turned), &
      & new_unittest('volume and inertia of a torus and a prism', test_round), &
      & new_unittest('cavities and several shells', test_shells), &
      & new_unittest('text and binary files give the same points', test_formats), &
      & new_unittest('winding numbers near a gap', test_winding), &
      & new_unittest('a small gap changes no cell, a large one is refused', test_gap), &
      & new_unittest('corners that differ by rounding are one', test_rounding), &
      & new_unittest('facets that pass through each other are counted', test_crossings), &
      & new_unittest('surfaces without crossings have none', test_no_crossings), &
      & new_unittest('the same cells on any number of threads', test_threads), &
      & new_unittest('areas shared among points close the body', test_shares), &
      & new_unittest('pressure and force on sides', test_loads), &
      & new_unittest('boundaries move the points near facets', test_boundary), &
      & new_unittest('regions and removed parts inside of surfaces', test_regions), &
      & new_unittest('layers and lattice families', test_layers), &
      & new_unittest('cracks that are surfaces', test_cracks), &
      & new_unittest('surfaces without an inside are refused', test_bad_surfaces), &
      & new_unittest('damaged files are refused with their place', test_damaged), &
      & new_unittest('what is refused when a scene is read or built', test_refused), &
      & new_unittest('mutants neither crash nor hang', test_mutants)]
  end subroutine collect_body_surfaces

  !> The scene of a body in build/part.stl with these keys, and more groups.
  function scene_with(keys, more) result(text)
    character(*), intent(in) :: keys
    character(*), intent(in), optional :: more
    character(:), allocatable :: text

    text = '&scene dimension = 3 /'//lf//"&body name = 'part' surface = 'part.stl' "//keys//' /' &
      & //lf//steel
    if (present(more)) text = text//more//lf
  end function scene_with

  !> The points of a scene.
  subroutine points_of(text, body, error, fault, scene_read)
    character(*), intent(in) :: text
    type(body_type), intent(out) :: body
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable, intent(out), optional :: fault
    type(scene_type), intent(out), optional :: scene_read
    type(scene_type) :: scene
    type(fault_type), allocatable :: found
    real(wp) :: delta

    if (allocated(error)) return
    call read_scene_text(text, 'build/surfaces.nml', scene, found)
    if (.not. allocated(found)) call generate_body(scene, body, delta, found)
    if (present(scene_read)) scene_read = scene
    if (present(fault)) then
      if (allocated(found)) call move_alloc(found, fault)
    else if (allocated(found)) then
      call test_failed(error, found%message)
    end if
  end subroutine points_of

  !> The crossings of facets, on one thread and on many.
  subroutine crossings_of(x, found, error)
    real(wp), intent(in) :: x(:, :, :)
    type(crossings_type), intent(out) :: found
    type(error_type), allocatable, intent(inout) :: error
    type(crossings_type) :: again
    type(surface_type) :: surface
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text
    integer :: threads

    text = binary_stl(x)
    call read_stl_text(text, 'made.stl', 1.0_wp, surface, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (allocated(error)) return
    threads = omp_get_max_threads()
    call omp_set_num_threads(1)
    call find_crossings(surface, found)
    call omp_set_num_threads(4)
    call find_crossings(surface, again)
    call omp_set_num_threads(threads)
    call expect_true(error, again%n == found%n .and. all(again%first == found%first) .and. &
      & all(abs(again%place - found%place) <= 0.0_wp), 'the same on any number of threads')
  end subroutine crossings_of

  !> A facet that leans through another one along a line that is known, a common corner, and boxes.
  subroutine test_crossings(error)
    type(error_type), allocatable, intent(out) :: error
    type(crossings_type) :: found
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault
    real(wp) :: x(3, 3, 2), v(4), low, high, lean
    integer :: k, crossed

    crossed = 0
    do k = 1, 400
      call random_number(v)
      x(:, :, 1) = reshape([0, 0, 0, 1, 0, 0, 0, 1, 0], [3, 3])
      ! at half its height, z = 0, it goes from x = low to high at y = v(3)
      low = 2.4_wp*v(1) - 0.7_wp
      high = low + 0.2_wp + v(2)
      lean = v(4) - 0.5_wp
      x(:, 1, 2) = [low, v(3) - lean, -1.0_wp] - [high - low, 0.0_wp, 0.0_wp]/2
      x(:, 2, 2) = [high, v(3) - lean, -1.0_wp] + [high - low, 0.0_wp, 0.0_wp]/2
      x(:, 3, 2) = [(low + high)/2, v(3) + lean, 1.0_wp]
      call crossings_of(x, found, error)
      if (allocated(error)) return
      ! at y the first facet reaches from 0 to 1 - y
      if (abs(high) < 1.0e-3_wp .or. abs(low - 1 + v(3)) < 1.0e-3_wp) cycle
      call expect_true(error, (found%n == 1_i8) .eqv. (high > 0.0_wp .and. low < 1.0_wp - v(3)), &
        & 'a leaning facet')
      if (found%n == 0_i8) cycle
      crossed = crossed + 1
      call expect_close(error, found%place(2:3), [v(3), 0.0_wp], 2.0e-6_wp, 'where it crosses')
      call expect_true(error, all(found%first == [1, 2]), 'which facets')
    end do
    call expect_true(error, crossed > 50 .and. crossed < 350, 'some cross, some do not')
    x(:, :, 2) = reshape([0.0_wp, 0.0_wp, 0.0_wp, 0.3_wp, 0.2_wp, 1.0_wp, 0.2_wp, 0.3_wp, &
      & -1.0_wp], [3, 3])
    call crossings_of(x, found, error)
    if (allocated(error)) return
    call expect_true(error, found%n == 1_i8, 'with a common corner')
    call crossings_of(joined(box_facets([0.0_wp, 0.0_wp, 0.0_wp], [2.0_wp, 2.0_wp, 2.0_wp]), &
      & box_facets([0.5_wp, 0.5_wp, 1.0_wp], [1.5_wp, 1.5_wp, 3.0_wp])), found, error)
    if (allocated(error)) return
    ! the sides of the upper box, some of its edges through the diagonal of the face
    call expect_true(error, found%n >= 8_i8 .and. found%n <= 16_i8, 'a box in a face')
    call expect_close(error, found%place(3), 2.0_wp, 1.0e-6_wp, 'at that face')
    call write_file('part.stl', ascii_stl(joined(box_facets([0.0_wp, 0.0_wp, 0.0_wp], [2.0_wp, &
      & 2.0_wp, 2.0_wp]), box_facets([0.5_wp, 0.5_wp, 1.0_wp], [1.5_wp, 1.5_wp, 3.0_wp])), 'box'))
    call read_scene_text(scene_with('spacing = 0.25'), 'build/surfaces.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, index(set_up%warnings%text(), "the body 'part': "// &
      & to_text(found%n)//' pairs of facets pass through each other, the first at build/part.stl:' &
      & ) > 0, 'is warned of with its lines')
  end subroutine test_crossings

  !> Round, turned and several bodies, boxes that touch in a face or have facets in common.
  subroutine test_no_crossings(error)
    type(error_type), allocatable, intent(out) :: error
    type(crossings_type) :: found
    real(wp), parameter :: a(3) = 0.0_wp, b(3) = 1.0_wp, c(3) = [1.0_wp, 0.25_wp, 0.25_wp], &
      & d(3) = [2.0_wp, 0.75_wp, 0.75_wp]
    integer :: k

    do k = 1, 6
      select case (k)
      case (1)
        call crossings_of(torus_facets(1.0_wp, 0.3_wp, 60, 30), found, error)
      case (2)
        call crossings_of(turned(joined(torus_facets(1.0_wp, 0.3_wp, 40, 20), ball_facets(&
          & 0.6_wp, 16))), found, error)
      case (3)
        call crossings_of(joined(box_facets(a, b), box_facets(c, d)), found, error)
      case (4)
        call crossings_of(turned(joined(box_facets(a, b), box_facets(c, d))), found, error)
      case (5)
        call crossings_of(joined(box_facets(a, b), box_facets(a, b)), found, error)
      case default
        call crossings_of(turned(joined(box_facets(a, b), reversed(box_facets(b/4, b/2)))), &
          & found, error)
      end select
      if (allocated(error)) return
      call expect_true(error, found%n == 0_i8, 'no crossing')
    end do
    ! the torus through the ball
    call crossings_of(joined(torus_facets(1.0_wp, 0.3_wp, 40, 20), ball_facets(0.9_wp, 16)), &
      & found, error)
    if (allocated(error)) return
    call expect_true(error, found%n > 40_i8, 'a ball through a torus')
  end subroutine test_no_crossings

  !> Volume, centre, and the second moments about the centre, of points.
  subroutine measure(body, volume, centre, second)
    type(body_type), intent(in) :: body
    real(wp), intent(out) :: volume, centre(3), second(3, 3)
    integer :: a, b

    volume = sum(body%volume)
    do a = 1, 3
      centre(a) = sum(body%volume*body%x(:, a))/volume
    end do
    do b = 1, 3
      do a = 1, 3
        second(a, b) = sum(body%volume*(body%x(:, a) - centre(a))*(body%x(:, b) - centre(b)))
      end do
    end do
  end subroutine measure

  !> Rows of centres pass through the diagonals of the sides, and centres lie on the sides.
  subroutine test_box(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    integer :: n

    do n = 1, 9
      call write_file('part.stl', binary_stl(box_facets([0.0_wp, 0.0_wp, 0.0_wp], &
        & 1.0_wp*[n, n, n])))
      call points_of(scene_with('spacing = 1'), body, error)
      if (allocated(error)) return
      call expect_true(error, body%n_points == n**3, 'cells of a cube')
    end do
    ! lengths that single precision does not have
    call write_file('part.stl', ascii_stl(box_facets([0.1_wp, -0.2_wp, 0.3_wp], [1.1_wp, 1.8_wp, &
      & 0.8_wp])*1.0e3_wp, 'box'))
    call points_of(scene_with('spacing = 0.1 scale = 1e-3'), body, error)
    if (allocated(error)) return
    call expect_true(error, body%n_points == 1000, 'cells in millimetres')
    call expect_close(error, body%x(1, :), [0.15_wp, -0.15_wp, 0.35_wp], 1.0e-6_wp, 'the first')
    call points_of(scene_with('spacing = 0.1 scale = 1e-3 lower = 0.05, 0, 0'), body, error)
    if (allocated(error)) return
    call expect_close(error, modulo((body%x(:, 1) - 0.1_wp)/0.1_wp + 0.5_wp, 1.0_wp), 0.5_wp, &
      & 1.0e-6_wp, 'cells with a corner at lower')
    ! centres on the sides: lower ones count, upper ones do not
    call expect_true(error, body%n_points == 1000, 'half of the sides count')
  end subroutine test_box

  !> Exact for cut cells, but for the rounding of the file to single precision; of first order or
  !> better with whole ones.
  subroutine test_turned(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    real(wp), parameter :: edges(3) = [1.0_wp, 0.7_wp, 0.5_wp]
    real(wp) :: volume, centre(3), second(3, 3), exact, corner(3, 3, 12), errors(2, 3), middle(3)
    real(wp) :: inertia
    integer :: i
    character(*), parameter :: spacings(3) = [character(5) :: '0.1', '0.05', '0.025']

    corner = turned(box_facets([0.0_wp, 0.0_wp, 0.0_wp], edges))
    call write_file('part.stl', ascii_stl(corner, 'box'))
    exact = product(edges)
    middle = (minval(minval(corner, dim=3), dim=2) + maxval(maxval(corner, dim=3), dim=2))/2
    inertia = exact*sum(edges**2)/12
    do i = 1, 3
      call points_of(scene_with('spacing = '//spacings(i)//" fill = 'volume'"), body, error)
      if (allocated(error)) return
      call measure(body, volume, centre, second)
      call expect(error, volume, exact, 1.0e-6_wp, 'volume of cut cells')
      call expect_close(error, centre, middle, 1.0e-6_wp, 'centre of cut cells')
      errors(1, i) = abs(second(1, 1) + second(2, 2) + second(3, 3) - inertia)/inertia
      call points_of(scene_with('spacing = '//spacings(i)), body, error)
      if (allocated(error)) return
      call measure(body, volume, centre, second)
      errors(2, i) = abs(volume - exact)/exact
      call expect_close(error, centre, middle, 0.1_wp*0.1_wp/2**(i - 1), 'centre of whole cells')
      call expect_true(error, abs(second(1, 1) + second(2, 2) + second(3, 3) - inertia)/inertia &
        & < 0.1_wp/2**(i - 1), 'inertia of whole cells')
    end do
    ! second order: the second moment of a cell about its own point is missing
    call expect_true(error, errors(1, 3) < errors(1, 1)/14 .and. errors(1, 1) < 0.02_wp, &
      & 'inertia of cut cells, order 2')
    call expect_true(error, all(errors(2, :) < 0.06_wp/[1, 2, 4]), 'volume of whole cells, order 1')
  end subroutine test_turned

  !> Against the formulas of a torus, which facets approach, and of a prism.
  subroutine test_round(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    real(wp) :: volume, centre(3), second(3, 3), exact
    real(wp), parameter :: large = 3.0_wp, small = 1.0_wp
    integer :: i
    character(6), parameter :: fills(2) = [character(6) :: 'centre', 'volume']
    real(wp), parameter :: close(2) = [1.0e-2_wp, 2.0e-3_wp]

    call write_file('part.stl', binary_stl(torus_facets(large, small, 200, 120)))
    do i = 1, 2
      call points_of(scene_with("spacing = 0.1 fill = '"//trim(fills(i))//"'"), body, error)
      if (allocated(error)) return
      call measure(body, volume, centre, second)
      exact = 2*pi**2*large*small**2
      call expect(error, volume/exact, 1.0_wp, close(i), 'volume of the torus '//fills(i))
      call expect_close(error, centre, 0.0_wp, 1.0e-3_wp, 'its centre')
      call expect(error, (second(1, 1) + second(2, 2))/(exact*(large**2 + 0.75_wp*small**2)), &
        & 1.0_wp, close(i), 'its inertia')
    end do
    call write_file('part.stl', binary_stl(prism_facets(1.0_wp, 2.0_wp, 7)))
    call points_of(scene_with("spacing = 0.1 fill = 'volume'"), body, error)
    if (allocated(error)) return
    call expect(error, sum(body%volume), 7*sin(2*pi/7), 1.0e-6_wp, 'volume of the prism')
    call expect_true(error, minval(body%volume) >= 0.05_wp*0.1_wp**3*(1 - 1.0e-9_wp), 'no slivers')
    call points_of(scene_with("spacing = 0.05"), body, error)
    if (allocated(error)) return
    call expect(error, sum(body%volume)/(7*sin(2*pi/7)), 1.0_wp, 0.02_wp, &
      & 'whole cells of the prism')
  end subroutine test_round

  subroutine test_shells(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    real(wp), parameter :: o = 0.0_wp
    real(wp) :: hollow(3, 3, 24), two(3, 3, 24)
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    hollow = joined(box_facets([o, o, o], [10.0_wp, 10.0_wp, 10.0_wp]), reversed(box_facets( &
      & [3.0_wp, 3.0_wp, 3.0_wp], [7.0_wp, 7.0_wp, 7.0_wp])))
    call write_file('part.stl', binary_stl(hollow))
    call points_of(scene_with('spacing = 0.5'), body, error)
    if (allocated(error)) return
    call expect(error, sum(body%volume), 936.0_wp, 1.0e-9_wp, 'a box with a cavity')
    call points_of(scene_with("spacing = 0.7 fill = 'volume'"), body, error)
    if (allocated(error)) return
    call expect(error, sum(body%volume), 936.0_wp, 1.0e-9_wp, 'with cut cells')
    two = joined(box_facets([o, o, o], [2.0_wp, 2.0_wp, 2.0_wp]), box_facets([2.0_wp, 2.0_wp, o], &
      & [4.0_wp, 4.0_wp, 2.0_wp]))
    call write_file('part.stl', binary_stl(two))
    call points_of(scene_with("spacing = 0.3 fill = 'volume'"), body, error)
    if (allocated(error)) return
    call expect(error, sum(body%volume), 16.0_wp, 1.0e-9_wp, 'two boxes that share an edge')
    ! a cavity that faces outwards counts as solid, and is told
    call write_file('part.stl', binary_stl(joined(box_facets([o, o, o], [10.0_wp, 10.0_wp, &
      & 10.0_wp]), box_facets([3.0_wp, 3.0_wp, 3.0_wp], [7.0_wp, 7.0_wp, 7.0_wp]))))
    call read_scene_text(scene_with('spacing = 1'), 'build/surfaces.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, set_up%system%body%n_points == 1000, 'a full box')
    call expect_true(error, set_up%warnings%has('shells of surface 1'), 'is warned of')
    call expect_true(error, .not. set_up%warnings%has('crossings of surface 1'), 'apart')
    call expect_true(error, index(set_up%warnings%text(), 'the first near (3.5, 3.5, 3.5) m') > 0, &
      & 'with its place')
    call expect_true(error, .not. set_up%warnings%has('volume of surface 1'), 'the volume fits')
    ! a sheet of one cell is thicker than the surface
    call write_file('part.stl', binary_stl(box_facets([o, o, o], [9.0_wp, 9.0_wp, 0.4_wp])))
    call read_scene_text(scene_with('spacing = 1'), 'build/surfaces.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, set_up%warnings%has('volume of surface 1'), 'the volume does not')
    call write_file('part.stl', binary_stl(joined(box_facets([o, o, o], [10.0_wp, 10.0_wp, &
      & 10.0_wp]), box_facets([3.0_wp, 3.0_wp, 3.0_wp], [7.0_wp, 7.0_wp, 7.0_wp]))))
    call points_of(scene_with("spacing = 1 fill = 'volume'"), body, error, fault)
    call expect_parts(error, fault, 'shells of the surface overlap|part.stl')
  end subroutine test_shells

  subroutine test_formats(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body, other
    real(wp), allocatable :: x(:, :, :)

    x = turned(torus_facets(3.0_wp, 1.0_wp, 30, 20))
    call write_file('part.stl', binary_stl(x))
    call points_of(scene_with("spacing = 0.3 fill = 'volume'"), body, error)
    call write_file('part.stl', ascii_stl(x, 'some name'))
    call points_of(scene_with("spacing = 0.3 fill = 'volume'"), other, error)
    if (allocated(error)) return
    call expect_true(error, body%n_points == other%n_points, 'points')
    ! nine digits tell single precision, and the text is read as those digits
    if (body%n_points == other%n_points) then
      call expect_close(error, body%x, other%x, 1.0e-7_wp, 'places')
      call expect_close(error, body%volume, other%volume, 1.0e-7_wp, 'volumes')
    end if
    x = anint(x*1024)/1024
    call write_file('part.stl', binary_stl(x))
    call points_of(scene_with("spacing = 0.3 fill = 'volume'"), body, error)
    call write_file('part.stl', ascii_stl(x*4, 'some name'))
    call points_of(scene_with("spacing = 0.3 fill = 'volume' scale = 0.25"), other, error)
    if (allocated(error)) return
    call expect_true(error, body%n_points == other%n_points, 'points')
    if (body%n_points == other%n_points) then
      call expect_close(error, body%x, other%x, 0.0_wp, 'places, every bit')
      call expect_close(error, body%volume, other%volume, 0.0_wp, 'volumes, every bit')
    end if
  end subroutine test_formats

  !> A ball without one facet: 1 inside and 0 outside, up to the solid angle of the gap.
  subroutine test_winding(error)
    type(error_type), allocatable, intent(out) :: error
    type(solid_type) :: solid
    type(tree_type) :: tree
    real(wp), allocatable :: x(:, :, :)
    real(wp) :: place(3), exact, r
    integer :: i

    x = ball_facets(1.0_wp, 40)
    call solid_of(x, solid, error)
    if (allocated(error)) return
    call new_tree(solid%surface, tree)
    do i = 1, 40
      r = 0.045_wp*i
      if (abs(r - 1) < 0.03_wp) cycle
      place = r*[cos(2.0_wp*i)*sin(1.0_wp*i), sin(2.0_wp*i)*sin(1.0_wp*i), cos(1.0_wp*i)]
      exact = merge(1.0_wp, 0.0_wp, r < 1)
      ! dipoles of nodes 2.5 radii away are wrong by some per cent of what they add
      call expect(error, winding_number(solid%surface, tree, place), exact, 0.02_wp, 'closed')
    end do
    ! half of it: half of the solid angle from the centre
    call solid_of(x(:, :, :size(x, 3)/2), solid, error, open=.true.)
    if (allocated(error)) return
    call new_tree(solid%surface, tree)
    call expect(error, winding_number(solid%surface, tree, [0.0_wp, 0.0_wp, 0.0_wp]), 0.5_wp, &
      & 0.01_wp, 'half a ball')
  end subroutine test_winding

  !> A solid from facets; `open`: without checks of closed ones.
  subroutine solid_of(x, solid, error, open)
    real(wp), intent(in) :: x(:, :, :)
    type(solid_type), intent(out) :: solid
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in), optional :: open
    character(:), allocatable :: text
    type(fault_type), allocatable :: fault

    text = binary_stl(x)
    call read_stl_text(text, 'part.stl', 1.0_wp, solid%surface, fault)
    if (.not. allocated(fault) .and. .not. present(open)) call new_solid(solid, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine solid_of

  !> The corners of each facet of a ball are moved by up to 1e-7 of its radius, as programs that
  !> compute them facet by facet write them: it is closed all the same. Moved by 1e-5 it is not.
  subroutine test_rounding(error)
    type(error_type), allocatable, intent(out) :: error
    type(solid_type) :: whole, solid
    real(wp), allocatable :: x(:, :, :), y(:, :, :)
    logical, allocatable :: inside(:), expected(:)
    real(wp) :: places(200, 3)
    integer :: f, i, c

    x = turned(ball_facets(1.0_wp, 20))
    y = x
    do f = 1, size(x, 3)
      do i = 1, 3
        do c = 1, 3
          y(c, i, f) = x(c, i, f) + 1.0e-7_wp*(modulo(0.618034_wp*(9*f + 3*i + c), 1.0_wp) - 0.5_wp)
        end do
      end do
    end do
    call solid_of(x, whole, error)
    call solid_of(y, solid, error)
    if (allocated(error)) return
    call expect_true(error, solid%edges%n_open == 0 .and. gaps_text(solid) == '', &
      & 'a ball with rounded corners is closed')
    call expect_true(error, solid%surface%n_facets == whole%surface%n_facets, 'all its facets')
    do i = 1, 200
      places(i, :) = 2.4_wp*modulo(i*[0.819173_wp, 0.671044_wp, 0.5497_wp], 1.0_wp) - 1.2_wp
    end do
    call points_inside(whole, places, 0.1_wp, expected)
    call points_inside(solid, places, 0.1_wp, inside)
    call expect_true(error, all(inside .eqv. expected) .and. count(inside) > 20, 'its inside')
    call solid_of(x + 100*(y - x), solid, error)
    if (allocated(error)) return
    call expect_true(error, solid%edges%n_open > size(x, 3), 'larger steps stay')
  end subroutine test_rounding

  subroutine test_gap(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: whole, body
    real(wp), allocatable :: x(:, :, :), y(:, :, :)
    logical, allocatable :: keep(:)
    type(fault_type), allocatable :: fault
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    integer :: f

    x = turned(ball_facets(1.0_wp, 60))
    call write_file('part.stl', binary_stl(x))
    call points_of(scene_with('spacing = 0.1'), whole, error)
    ! every hundredth facet, each smaller than a cell
    allocate (keep(size(x, 3)))
    keep = [(mod(f, 100) /= 50, f=1, size(x, 3))]
    y = x(:, :, pack([(f, f=1, size(x, 3))], keep))
    call write_file('part.stl', binary_stl(y))
    call points_of(scene_with('spacing = 0.1'), body, error)
    if (allocated(error)) return
    call expect_true(error, whole%n_points == body%n_points, 'the same cells')
    if (whole%n_points == body%n_points) call expect_close(error, body%x, whole%x, 1.0e-9_wp, &
      & 'at the same places')
    call points_of(scene_with("spacing = 0.1 fill = 'volume'"), body, error)
    if (allocated(error)) return
    call expect(error, sum(body%volume)/(4*pi/3), 1.0_wp, 0.01_wp, 'cut cells, hardly changed')
    call read_scene_text(scene_with('spacing = 0.1'), 'build/surfaces.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, set_up%warnings%has('gaps of surface 1'), 'gaps are warned of')
    ! without a cap as wide as ten cells
    keep = [(maxval(x(1, :, f)) < 1.15_wp, f=1, size(x, 3))]
    y = x(:, :, pack([(f, f=1, size(x, 3))], keep))
    call write_file('part.stl', binary_stl(y))
    call points_of(scene_with('spacing = 0.1'), body, error, fault)
    call expect_parts(error, fault, 'the surface is open|belong to one facet only|part.stl, facet')
  end subroutine test_gap

  subroutine test_threads(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: first, body
    real(wp), allocatable :: x(:, :, :)
    integer :: before, threads

    x = turned(torus_facets(3.0_wp, 1.0_wp, 60, 30))
    call write_file('part.stl', binary_stl(x(:, :, 2:)))
    before = omp_get_max_threads()
    do threads = 1, 4
      call omp_set_num_threads(threads)
      call points_of(scene_with("spacing = 0.2 fill = 'volume'"), body, error)
      if (allocated(error)) exit
      if (threads == 1) first = body
      call expect_true(error, body%n_points == first%n_points, 'points')
      if (allocated(error)) exit
      call expect_close(error, body%x, first%x, 0.0_wp, 'places')
      call expect_close(error, body%volume, first%volume, 0.0_wp, 'volumes')
    end do
    call omp_set_num_threads(before)
  end subroutine test_threads

  !> Sum A_k = 0 and sum A_k x_k^T = volume times identity, those of the facets.
  subroutine test_shares(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body
    real(wp), allocatable :: vector(:, :), area(:), x(:, :, :)
    real(wp) :: moment(3, 3), identity(3, 3)
    type(fault_type), allocatable :: fault
    integer :: a, b

    identity = 0.0_wp
    do a = 1, 3
      identity(a, a) = 1.0_wp
    end do
    x = turned(prism_facets(1.0_wp, 2.0_wp, 7))
    call write_file('part.stl', binary_stl(x))
    call points_of(scene_with('spacing = 0.15'), body, error)
    if (allocated(error)) return
    associate (skin => body%skins(1))
      call share_facets(skin%surface, spread(.true., 1, skin%surface%n_facets), body%x, &
        & skin%lattice%grid%origin, skin%lattice%grid%spacing, vector, area, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      do b = 1, 3
        do a = 1, 3
          moment(a, b) = sum(vector(:, a)*body%x(:, b))
        end do
      end do
      call expect_close(error, sum(vector, dim=1), 0.0_wp, 1.0e-12_wp, 'a closed surface')
      call expect_close(error, moment, skin%surface%volume*identity, 1.0e-12_wp, 'its volume')
      call expect(error, sum(area), 2*7*sin(pi/7)*2 + 7*sin(2*pi/7), 1.0e-5_wp, 'its area')
    end associate
  end subroutine test_shares

  !> The sum of force density times volume, and its first moment.
  subroutine total_of(set_up, number, force, moment)
    type(set_up_type), intent(in), target :: set_up
    integer, intent(in) :: number                  !! of the load
    real(wp), intent(out) :: force(3), moment(3, 3)
    type(load_type), pointer :: load
    integer :: i

    load => load_of(set_up%system%terms, number)
    force = 0.0_wp
    moment = 0.0_wp
    associate (body => set_up%system%body)
      do i = 1, size(load%slots)
        associate (f => load%density(i, :)*body%volume(load%slots(i)))
          force = force + f
          moment = moment + spread(f, 2, 3)*spread(body%x(load%slots(i), :), 1, 3)
        end associate
      end do
    end associate
  end subroutine total_of

  !> On a box whose sides lie across the lattice, by the name of a solid and by `&side`s.
  subroutine test_loads(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    real(wp) :: x(3, 3, 12), normal(3), centre(3), force(3), moment(3, 3)
    character(:), allocatable :: more
    character(20) :: words(3)
    integer :: i

    x = turned(box_facets([0.0_wp, 0.0_wp, 0.0_wp], [4.0_wp, 3.0_wp, 2.0_wp]))
    call write_file('part.stl', ascii_stl(x(:, :, :2), 'left')//ascii_stl(x(:, :, 3:4), 'right') &
      & //ascii_stl(x(:, :, 5:), 'rest'))
    ! from the first corner of each side to the opposite one
    normal = x(:, 1, 3) - x(:, 1, 1)
    normal = normal/norm2(normal)
    centre = (x(:, 1, 3) + x(:, 2, 4))/2
    do i = 1, 3
      write (words(i), '(es20.12)') normal(i)
    end do
    more = "&load side = 'part:RIGHT' pressure = 2e6 /"//lf// &
      & "&side name = 'end' normal = "//words(1)//','//words(2)//','//words(3)//' angle = 5 /'//lf &
      & //"&load side = 'part:end' force_y = 3e6 /"//lf//"&side name = 'all' where = 'x > -100' /"
    do i = 1, 2
      call read_scene_text(scene_with('spacing = 0.25'//trim(merge('                ', &
        & " fill = 'volume'", i == 1)), more//lf//"&load side = 'part:all' pressure = 1 /"), &
        & 'build/surfaces.nml', scene, fault)
      if (.not. allocated(fault)) call prepare(scene, set_up, fault)
      if (allocated(fault)) then
        call test_failed(error, fault%message)
        return
      end if
      call total_of(set_up, 1, force, moment)
      call expect_close(error, force/12.0e6_wp, -normal, 1.0e-6_wp, 'pressure')
      call expect_close(error, matmul(normal, moment)/12.0e6_wp, -centre, 1.0e-5_wp, &
        & 'its centre is that of the side')
      call total_of(set_up, 2, force, moment)
      call expect_close(error, force/3.0e6_wp, [0.0_wp, 1.0_wp, 0.0_wp], 1.0e-12_wp, 'force')
      call expect_close(error, moment(2, :)/3.0e6_wp, centre, 1.0e-6_wp, 'the centre of the force')
      call total_of(set_up, 3, force, moment)
      call expect_close(error, force, 0.0_wp, 1.0e-11_wp, 'pressure all around')
    end do
  end subroutine test_loads

  subroutine test_boundary(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    call write_file('part.stl', binary_stl(box_facets([0.0_wp, 0.0_wp, 0.0_wp], [8.0_wp, 4.0_wp, &
      & 4.0_wp])))
    call read_scene_text(scene_with('spacing = 1', "&horizon length = 1.52 /"//lf// &
      & "&side name = 'left' where = 'x < 0.1' /"//lf// &
      & "&boundary side = 'part:left' displacement_x = 0 /"), 'build/surfaces.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    associate (body => set_up%system%body, motion => set_up%system%motions(1))
      call expect_true(error, size(motion%slots) == 32, 'two rows')
      call expect_true(error, all(body%x(motion%slots, 1) < 2.0_wp), 'near the facets')
      call expect_true(error, all(body%layer == 0), 'no layer is added')
    end associate
  end subroutine test_boundary

  !> A surface of a box chooses the points that the shape of a box chooses.
  subroutine test_regions(error)
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: body, other
    type(scene_type) :: scene
    character(*), parameter :: block = '&scene dimension = 3 /'//lf//'&body lower = 0, 0, 0 '// &
      & 'upper = 5, 4, 3 points = 10, 8, 6 /'//lf//steel

    call write_file('part.stl', binary_stl(box_facets([1.1_wp, 1.1_wp, 0.6_wp], [2.9_wp, 3.1_wp, &
      & 2.1_wp])*1000))
    call points_of(block//"&region name = 'a' surface = 'part.stl' scale = 1e-3 /"//lf// &
      & "&region name = 'b' shape = 'box' lower = 1.1, 1.1, 0.6 upper = 2.9, 3.1, 2.1 /"//lf// &
      & "&region name = 'c' surface = 'part.stl' scale = 1e-3 where = 'x < 2' /"//lf, body, error, &
      & scene_read=scene)
    if (allocated(error)) return
    call expect_true(error, all(in_region(scene, body, 1) .eqv. in_region(scene, body, 2)), &
      & 'a region')
    call expect_true(error, count(in_region(scene, body, 1)) == 4*4*3, 'its points')
    call expect_true(error, all(in_region(scene, body, 3) .eqv. (in_region(scene, body, 2) .and. &
      & body%x(:, 1) < 2.0_wp)), 'with an expression')
    call points_of(block//"&remove surface = 'part.stl' scale = 1e-3 /"//lf, body, error)
    call points_of(block//"&remove shape = 'box' lower = 1.1, 1.1, 0.6 upper = 2.9, 3.1, 2.1 /"// &
      & lf, other, error)
    if (allocated(error)) return
    call expect_true(error, body%n_points == other%n_points .and. body%n_points == 432, 'removed')
    if (body%n_points == other%n_points) call expect_close(error, body%x, other%x, 0.0_wp, &
      & 'the rest')
  end subroutine test_regions

  !> Layers go on outside of a surface as outside of a box; families are those of lattices.
  subroutine test_layers(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    type(body_type) :: body
    real(wp) :: volume

    call write_file('part.stl', binary_stl(box_facets([0.0_wp, 0.0_wp, 0.0_wp], [8.0_wp, 4.0_wp, &
      & 4.0_wp])))
    call read_scene_text(scene_with('spacing = 1', "&boundary side = 'x_min' displacement_x = 0 /" &
      & //lf//"&load side = 'x_max' pressure = 1e6 /"//lf//"&horizon family = 'lattice' /"), &
      & 'build/surfaces.nml', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    call expect_true(error, set_up%system%body%n_points == 128 + 48, 'a layer of three rows')
    call expect_true(error, count(set_up%system%body%layer > 0) == 48, 'that is its layer')
    ! two bodies on one grid, and two that overlap
    call write_file('other.stl', binary_stl(box_facets([8.0_wp, 0.0_wp, 0.0_wp], [9.0_wp, 4.0_wp, &
      & 4.0_wp])))
    call points_of(scene_with('spacing = 1', "&body name = 'more' surface = 'other.stl' "// &
      & 'spacing = 1 lower = 0, 0, 0 /'), body, error)
    if (allocated(error)) return
    volume = sum(body%volume)
    call expect(error, volume, 144.0_wp, 1.0e-9_wp, 'two bodies')
    call expect_true(error, size(body%grids) == 1, 'on one grid')
    call write_file('other.stl', binary_stl(box_facets([7.0_wp, 0.0_wp, 0.0_wp], [9.0_wp, 4.0_wp, &
      & 4.0_wp])))
    call points_of(scene_with('spacing = 1', "&body name = 'more' surface = 'other.stl' "// &
      & 'spacing = 1 /'), body, error, fault)
    call expect_parts(error, fault, 'overlap')
  end subroutine test_layers

  !> Two facets cut the bonds that a parallelogram cuts. A ball parts its inside, which is convex,
  !> from the outside: bonds between both are cut, those inside are not.
  subroutine test_cracks(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(bonds_type) :: bonds
    real(wp), allocatable :: x(:, :, :)
    logical, allocatable :: inside(:)
    type(solid_type) :: solid
    integer(i8) :: cut
    integer :: k, i, wrong
    character(*), parameter :: block = '&scene dimension = 3 /'//lf//'&body lower = 0, 0, 0 '// &
      & 'upper = 5, 4, 3 points = 10, 8, 6 /'//lf//steel

    call ready(block//'&crack corner = 2.52, 0.6, 0.3 edge_1 = 0.1, 2.1, 0 edge_2 = 0, 0.2, 1.6 /')
    if (allocated(error)) return
    cut = set_up%cut
    x = 0*box_facets([0.0_wp, 0.0_wp, 0.0_wp], [1.0_wp, 1.0_wp, 1.0_wp])
    x(:, :, 1) = reshape([2.52_wp, 0.6_wp, 0.3_wp, 2.62_wp, 2.7_wp, 0.3_wp, 2.62_wp, 2.9_wp, &
      & 1.9_wp], [3, 3])
    x(:, :, 2) = reshape([2.52_wp, 0.6_wp, 0.3_wp, 2.62_wp, 2.9_wp, 1.9_wp, 2.52_wp, 0.8_wp, &
      & 1.9_wp], [3, 3])
    call write_file('part.stl', ascii_stl(x(:, :, :2)*1000, 'crack'))
    call ready(block//"&crack surface = 'part.stl' scale = 1e-3 /")
    if (allocated(error)) return
    call expect_true(error, set_up%cut == cut .and. cut > 0_i8, 'the bonds of a parallelogram')
    x = ball_facets(1.1_wp, 24)
    x(1, :, :) = x(1, :, :) + 2.4_wp
    x(2, :, :) = x(2, :, :) + 2.0_wp
    x(3, :, :) = x(3, :, :) + 1.6_wp
    call write_file('part.stl', binary_stl(x))
    call ready(block//"&crack surface = 'part.stl' /")
    if (allocated(error)) return
    call solid_of(x, solid, error)
    associate (body => set_up%system%body, family => set_up%system%family)
      call points_inside(solid, body%x, 0.5_wp, inside)
      call allocate_bonds(family, bonds)
      wrong = 0
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        call family%bonds_of(k, bonds)
        do i = 1, bonds%n
          if (inside(k) .neqv. inside(bonds%j(i))) then
            if (bonds%intact(i)) wrong = wrong + 1
          else if (inside(k) .and. .not. bonds%intact(i)) then
            wrong = wrong + 1
          end if
        end do
      end do
      call expect_true(error, wrong == 0 .and. any(inside .and. body%point > 0), &
        & 'a ball is parted from the rest')
    end associate

  contains

    subroutine ready(text)
      character(*), intent(in) :: text
      type(scene_type) :: scene
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call read_scene_text(text, 'build/surfaces.nml', scene, fault)
      if (.not. allocated(fault)) call prepare(scene, set_up, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
    end subroutine ready

  end subroutine test_cracks

  subroutine test_bad_surfaces(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: x(3, 3, 12), y(3, 3, 12)
    real(wp), parameter :: o = 0.0_wp

    x = box_facets([o, o, o], [4.0_wp, 4.0_wp, 4.0_wp])
    call refuse(reversed(x), 'the surface is inside out|part.stl, facet 1')
    y = x
    y(:, :, 5) = x(:, [2, 1, 3], 5)
    call refuse(y, 'face opposite ways|part.stl, facet')
    call refuse(x(:, :, :10), 'the surface is open')
    call refuse(joined(x, x(:, :, :1)), '3 facets meet at the edge|a wall inside|part.stl, facet')
    call refuse(joined(x, reversed(box_facets([6.0_wp, o, o], [8.0_wp, 2.0_wp, 2.0_wp]))), &
      & 'a shell of the surface is inside out')
    call refuse(spread(reshape([o, o, o, 1.0_wp, o, o, o, 1.0_wp, o], [3, 3]), 3, 1), &
      & 'holds no volume')
    call refuse(0*x, 'has no facets')
    call refuse(1.0e-6_wp*x, 'less than half a cell of|it is 4e-6 x 4e-6 x 4e-6 m')
    call refuse(1.0e6_wp*x, "too many cells|scale")
    call refuse(1.0e12_wp*x, "too many cells|scale")

  contains

    subroutine refuse(facets, parts)
      real(wp), intent(in) :: facets(:, :, :)
      character(*), intent(in) :: parts
      type(body_type) :: body
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call write_file('part.stl', binary_stl(facets))
      call points_of(scene_with('spacing = 0.5'), body, error, fault)
      call expect_parts(error, fault, parts)
    end subroutine refuse

  end subroutine test_bad_surfaces

  subroutine test_damaged(error)
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: binary, text
    real(wp) :: x(3, 3, 12)
    integer :: at

    x = box_facets([0.0_wp, 0.0_wp, 0.0_wp], [4.0_wp, 4.0_wp, 4.0_wp])
    binary = binary_stl(x)
    text = ascii_stl(x, 'box')
    call refuse('', 'empty')
    call refuse('nonsense', 'this is no STL file|part.stl:1')
    call refuse(binary(:len(binary) - 1), 'facets has 684 bytes, this one has 683|cut off')
    call refuse(binary//'x', 'facets has 684 bytes, this one has 685')
    call refuse(binary(:80)//char(255)//char(255)//char(255)//char(255)//binary(85:), &
      & '4294967295 facets')
    call refuse(binary(:84 + 50*3 + 12)//char(0)//char(0)//char(192)//char(127)// &
      & binary(84 + 50*3 + 17:), 'facet 4 has a corner that is not finite|part.stl, byte 247')
    call refuse(text(:300), 'the file ends|part.stl:')
    at = index(text, 'endloop')
    call refuse(text(:at - 1)//'endlop'//text(at + 7:), "expected 'endloop', but found "// &
      & "'endlop'|part.stl:7")
    at = index(text, 'vertex')
    call refuse(text(:at + 6)//'1,5'//text(at + 7:), "expected a coordinate of facet 1, but "// &
      & "found '1,5'|part.stl:4")
    call refuse(text(:at + 6)//'nan'//text(at + 7:), 'finite number|part.stl:4')
    call refuse(text//'rubbish', "expected 'solid' or the end of the file|rubbish")
    call refuse('solid'//lf//'endsolid', 'has no facets')

  contains

    subroutine refuse(file, parts)
      character(*), intent(in) :: file, parts
      type(body_type) :: body
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call write_file('part.stl', file)
      call points_of(scene_with('spacing = 0.5'), body, error, fault)
      call expect_parts(error, fault, parts)
    end subroutine refuse

  end subroutine test_damaged

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error

    call write_file('part.stl', ascii_stl(box_facets([0.0_wp, 0.0_wp, 0.0_wp], [4.0_wp, 4.0_wp, &
      & 4.0_wp]), 'cube'))
    call refuse(scene_with(''), "lacks the key 'spacing'")
    call refuse(scene_with('spacing = 0'), 'spacing')
    call refuse(scene_with("spacing = 1 fill = 'half'"), 'fill')
    call refuse(scene_with('spacing = 1 upper = 1, 1, 1'), 'not several of them')
    call refuse(scene_with("spacing = 1 file = 'x.txt'"), 'not several of them')
    call refuse(scene_with('spacing = 1 points_per_element = 8'), 'keys of a mesh')
    call refuse(scene_with('spacing = 1 lower = 1, 1'), "'lower' has too few values")
    call refuse("&scene dimension = 2 /"//lf//"&body surface = 'part.stl' spacing = 1 /"//lf// &
      & steel, 'a surface in a scene of dimension 2')
    call refuse("&scene dimension = 3 /"//lf//"&body surface = 'none.stl' spacing = 1 /"//lf// &
      & steel, "cannot find the file 'none.stl'")
    call refuse("&scene dimension = 3 /"//lf//"&body lower = 0, 0, 0 upper = 1, 1, 1 points = "// &
      & '2, 2, 2 spacing = 0.5 /'//lf//steel, "a body without a shape has no key 'spacing'")
    call refuse(scene_with("spacing = 1 fill = 'volume'", &
      & "&boundary side = 'x_min' displacement_x = 0 /"), 'has no rows and gets no layers')
    call refuse(scene_with("spacing = 0.2 fill = 'volume'", &
      & "&horizon surface_correction = 'consistent' /"), &
      & "surface_correction = 'consistent' does not serve cells that a surface cuts")
    call refuse(scene_with('spacing = 1', "&load region = 'part:cube' force_x = 1 /"), &
      & 'names facets of a surface, not points')
    call refuse(scene_with('spacing = 1', "&load side = 'part:cub' pressure = 1 /"), &
      & "named 'cub'|did you mean 'cube'|surfaces.nml:5")
    call refuse(scene_with('spacing = 1', "&side name = 'a' where = 'x > 100' /"//lf// &
      & "&load side = 'part:a' pressure = 1 /"), "no facet of the surface belongs to")
    call refuse(scene_with('spacing = 1', "&side name = 'a' /"), &
      & "lacks the key 'where' or 'normal'")
    call refuse(scene_with('spacing = 1', "&side name = 'a' normal = 0, 0, 0 /"), "is zero")
    call refuse(scene_with('spacing = 1', "&remove surface = 'part.stl' shape = 'box' /"), &
      & "'surface' beside a shape")
    call refuse(scene_with('spacing = 1', "&remove surface = 'part.stl' /"), 'no points')
    call refuse(scene_with('spacing = 1', "&region name = 'r' surface = 'no.stl' /"), &
      & "cannot find the file 'no.stl'")
    call refuse(scene_with('spacing = 1', "&crack surface = 'part.stl' radius = 1 /"), &
      & "'surface' beside another kind of crack")
    call refuse(scene_with('spacing = 1', "&crack surface = 'no.stl' /"), 'cannot find')
    call refuse(scene_with("spacing = 1 fill = 'volume'", "&horizon family = 'lattice' /"), &
      & 'cut cells')

  contains

    subroutine refuse(text, parts)
      character(*), intent(in) :: text, parts
      type(set_up_type) :: set_up
      type(scene_type) :: scene
      type(fault_type), allocatable :: fault

      if (allocated(error)) return
      call read_scene_text(text, 'build/surfaces.nml', scene, fault)
      if (.not. allocated(fault)) call prepare(scene, set_up, fault)
      call expect_parts(error, fault, parts)
    end subroutine refuse

  end subroutine test_refused

  !> Bytes, words and numbers of a text and of a binary file are changed at random. Each mutant is
  !> read, checked and filled, or refused with the name of its file.
  subroutine test_mutants(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 600
    character(:), allocatable :: text, binary, plain
    real(wp), allocatable :: x(:, :, :)
    integer :: m, accepted, seeds
    integer, allocatable :: seed(:)

    x = turned(torus_facets(3.0_wp, 1.0_wp, 8, 6))
    binary = binary_stl(x)
    plain = ascii_stl(x, 'ring')
    call random_seed(size=seeds)
    allocate (seed(seeds), source=20261129)
    call random_seed(put=seed)
    accepted = 0
    do m = 1, n
      if (mod(m, 2) == 0) then
        text = binary
      else
        text = plain
      end if
      call change_it()
      call try_it()
      if (allocated(error)) return
    end do
    call expect_true(error, accepted > n/50, 'hardly a mutant gets through to the end')

  contains

    integer function random_to(most)
      integer, intent(in) :: most
      real(wp) :: r
      call random_number(r)
      random_to = min(most, 1 + int(r*most))
    end function random_to

    subroutine change_it()
      integer :: times, at, length
      character(7) :: word
      character(7), parameter :: words(12) = [character(7) :: 'nan', '1e38', '-1e38', '1e-38', &
        & 'solid', 'facet', 'endloop', '0', '-0', '1e999', '1.5.2', 'inf']

      do times = 1, random_to(3)
        at = random_to(len(text))
        length = min(len(text) - at + 1, random_to(60))
        select case (random_to(6))
        case (1); text(at:at) = char(random_to(256) - 1)
        case (2); text = text(:at - 1)//text(at + length:)
        case (3); text = text(:at)
        case (4); text = text(:at + length - 1)//text(at:)
        case (5)
          word = words(random_to(size(words)))
          text = text(:at - 1)//trim(word)//text(min(len(text) + 1, at + len_trim(word)):)
        case default; text(at:at) = char(ieor(ichar(text(at:at)), 2**(random_to(8) - 1)))
        end select
        if (len(text) == 0) text = ' '
      end do
    end subroutine change_it

    subroutine try_it()
      type(solid_type) :: solid
      type(fault_type), allocatable :: fault
      integer(i1), allocatable :: windings(:, :, :)
      logical, allocatable :: inside(:)
      real(wp) :: h, places(20, 3)
      integer :: p

      call read_stl_text(text, 'part.stl', 1.0_wp, solid%surface, fault)
      if (.not. allocated(fault)) call new_solid(solid, fault)
      if (.not. allocated(fault)) then
        h = maxval(solid%surface%high - solid%surface%low)/12
        call fill_cells(solid, solid%surface%low, h, [12, 12, 12], windings, fault)
        do p = 1, 20
          places(p, :) = solid%surface%low + p/20.0_wp*(solid%surface%high - solid%surface%low)
        end do
        call points_inside(solid, places, h, inside)
      end if
      if (allocated(fault)) then
        call expect_true(error, index(fault%message, 'part.stl') > 0, 'no file in: '// &
          & fault%message)
      else
        accepted = accepted + 1
      end if
    end subroutine try_it

  end subroutine test_mutants

end module test_body_surfaces
