!> Places inside of meshes, and lattices that are cut by them.
module test_body_mesh_inside
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_body_body, only: body_type
  use pd_body_generate, only: generate_body
  use pd_body_mesh_elements, only: kind_tetrahedron, kind_triangle, kind_wedge, shape_functions, &
    & shape_numbered, shape_type
  use pd_body_mesh_inside, only: places_in_mesh
  use pd_body_mesh_mesh, only: mesh_type
  use pd_body_mesh_read, only: read_mesh_text
  use pd_body_regions, only: check_regions, in_region, in_shape
  use pd_scene_content_read, only: read_scene_text
  use pd_scene_content_types, only: scene_type
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: expect_true
  use comparisons, only: expect_close
  use meshes, only: block_sample, gmsh_text, sample_type, write_file
  use test_scene_expect, only: expect_parts
  implicit none (type, external)
  private
  public :: collect_body_mesh_inside

  character(1), parameter :: lf = achar(10)
  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: ratio(3) = [0.8191725133961645_wp, 0.6710436067037893_wp, &
    & 0.5497004779019703_wp]  !! multiples of these, without their whole parts, fill a cube evenly
  real(wp), parameter :: lengths(3) = [3.0_wp, 1.5_wp, 0.8_wp]
  character(*), parameter :: steel = "&material youngs_modulus = 2e11 poissons_ratio = 0.25 "// &
    & 'density = 7850 /'//lf//'&time steps = 1 /'//lf
  character(*), parameter :: plane = '&scene dimension = 2 thickness = 0.1 /'//lf// &
    & '&body lower = -1, -1 upper = 5, 3 points = 60, 40 /'//lf//steel

contains

  subroutine collect_body_mesh_inside(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('places in bent blocks of every shape', test_blocks), &
      & new_unittest('places in a skewed block of every shape', test_skewed), &
      & new_unittest('nodes belong to a mesh, and what is within the tolerance', test_surface), &
      & new_unittest('places in one element that is an arc', test_arcs), &
      & new_unittest('lattices that are cut by meshes', test_cuts), &
      & new_unittest('what is refused', test_refused)]
  end subroutine collect_body_mesh_inside

  !> Whether a shape has nodes between its corners, so that it can be bent.
  pure logical function bends(shape)
    integer, intent(in) :: shape
    bends = any(shape == [5, 7, 8, 10, 12, 13, 15])
  end function bends

  !> A block [0, lengths] whose places are moved.
  subroutine make(shape, bend, skew, mesh, error)
    integer, intent(in) :: shape
    real(wp), intent(in) :: bend, skew
    type(mesh_type), intent(out) :: mesh
    type(error_type), allocatable, intent(inout) :: error
    type(sample_type) :: sample
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text
    integer :: i

    call block_sample(shape, [3, 2, 2], lengths, sample)
    do i = 1, sample%n_nodes
      sample%x(:, i) = moved(sample%dim, bend, skew, sample%x(:, i))
    end do
    text = gmsh_text(sample, 4, .true., .false.)
    call read_mesh_text(text, 'a.msh', sample%dim, 1.0_wp, mesh, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine make

  !> Where a place of the block goes: x grows by bend y^2, then y by skew x, and z falls by skew y.
  pure function moved(dim, bend, skew, x)
    integer, intent(in) :: dim
    real(wp), intent(in) :: bend, skew, x(3)
    real(wp) :: moved(3)

    moved = x
    if (dim > 1) moved(1) = x(1) + bend*x(2)**2
    if (dim > 1) moved(2) = x(2) + skew*moved(1)
    if (dim > 2) moved(3) = x(3) - skew*moved(2)
  end function moved

  !> Places in and around a block before it is moved, spread evenly: a mesh has those that were in
  !> the block.
  subroutine compare(shape, bend, skew, error)
    integer, intent(in) :: shape
    real(wp), intent(in) :: bend, skew
    type(error_type), allocatable, intent(inout) :: error
    integer, parameter :: n = 20000
    type(mesh_type) :: mesh
    real(wp) :: x(n, 3), own(3)
    logical :: expected(n)
    logical, allocatable :: inside(:)
    integer :: dim, i

    call make(shape, bend, skew, mesh, error)
    if (allocated(error)) return
    dim = merge(1, merge(2, 3, shape <= 8), shape <= 3)
    do i = 1, n
      own = lengths*(1.4_wp*modulo(i*ratio, 1.0_wp) - 0.2_wp)
      own(dim + 1:) = 0.0_wp
      expected(i) = all(own(:dim) >= 0.0_wp .and. own(:dim) <= lengths(:dim))
      x(i, :) = moved(dim, bend, skew, own)
    end do
    call places_in_mesh(mesh, dim, x(:, :dim), 0.0_wp, inside)
    call expect_true(error, count(expected) > n/4 .and. count(.not. expected) > n/4, &
      & 'too few places in or out')
    call expect_true(error, all(inside .eqv. expected), 'places in a block of shape '// &
      & achar(48 + shape/10)//achar(48 + mod(shape, 10)))
  end subroutine compare

  subroutine test_blocks(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: shape

    do shape = 2, 16
      if (.not. allocated(error)) call compare(shape, merge(0.2_wp, 0.0_wp, bends(shape)), 0.0_wp, &
        & error)
    end do
  end subroutine test_blocks

  subroutine test_skewed(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: shape

    do shape = 2, 16
      if (.not. allocated(error)) call compare(shape, merge(-0.15_wp, 0.0_wp, bends(shape)), &
        & 0.6_wp, error)
    end do
  end subroutine test_skewed

  !> The nodes of every mesh belong to it, those on its outside too, and what is just beyond does
  !> only within the tolerance.
  subroutine test_surface(error)
    type(error_type), allocatable, intent(out) :: error
    type(mesh_type) :: mesh
    real(wp), allocatable :: x(:, :)
    logical, allocatable :: inside(:)
    integer :: shape, dim

    do shape = 2, 16
      call make(shape, 0.0_wp, 0.3_wp, mesh, error)
      if (allocated(error)) return
      dim = merge(1, merge(2, 3, shape <= 8), shape <= 3)
      x = transpose(mesh%x(:dim, :mesh%n_nodes))
      call places_in_mesh(mesh, dim, x, 1.0e-9_wp, inside)
      call expect_true(error, all(inside), 'nodes of a mesh')
    end do
    call make(11, 0.0_wp, 0.0_wp, mesh, error)
    x = reshape([-1.0e-3_wp, -1.0e-3_wp, 3.0_wp, 0.7_wp, 0.7_wp, 1.501_wp, 0.4_wp, 0.4_wp, &
      & 0.4_wp], [3, 3])
    call places_in_mesh(mesh, 3, x, 1.0e-6_wp, inside)
    call expect_true(error, .not. any(inside), 'places beyond the tolerance')
    call places_in_mesh(mesh, 3, x, 1.1e-3_wp, inside)
    call expect_true(error, all(inside), 'places within the tolerance')
  end subroutine test_surface

  !> One element, bent to an arc of 50 degrees between the radii 1 and 2: what its map gives of its
  !> reference coordinates is inside, and what is beyond its radii or its angle is not.
  subroutine test_arcs(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: shapes(7) = [5, 7, 8, 10, 12, 13, 15], n = 4000
    type(shape_type) :: shape
    type(mesh_type) :: mesh
    real(wp) :: x(n, 3), away(n, 3), xi(3), values(27), gradients(3, 27), nodes(3, 27), low, r, a
    logical, allocatable :: inside(:)
    logical :: is_new
    integer :: s, i, k

    do s = 1, size(shapes)
      shape = shape_numbered(shapes(s))
      mesh = mesh_type(file='arc')
      low = merge(0.0_wp, -1.0_wp, any(shape%kind == [kind_triangle, kind_tetrahedron, kind_wedge]))
      do i = 1, shape%nodes
        r = 1 + (shape%reference(1, i) - low)/(1 - low)
        a = 50*pi/180*(shape%reference(2, i) - low)/(1 - low)
        nodes(:, i) = [r*cos(a), r*sin(a), shape%reference(3, i)]
        call mesh%add_node(int(i, i8), nodes(:, i), is_new)
      end do
      call mesh%add_element(1_i8, shapes(s), [(int(i, i4), i=1, shape%nodes)], is_new)
      k = 0
      do i = 1, 40*n
        if (k == n) exit
        xi = low + (1 - low)*modulo(i*ratio, 1.0_wp)
        if (shape%kind == kind_triangle .and. sum(xi(:2)) > 1) cycle
        if (shape%kind == kind_tetrahedron .and. sum(xi) > 1) cycle
        if (shape%kind == kind_wedge) then
          if (sum(xi(:2)) > 1) cycle
          xi(3) = 2*xi(3) - 1
        end if
        k = k + 1
        call shape_functions(shape, xi, values(:shape%nodes), gradients(:, :shape%nodes))
        x(k, :) = matmul(nodes(:, :shape%nodes), values(:shape%nodes))
        r = merge(0.97_wp - modulo(i*ratio(1), 0.9_wp), 2.03_wp + modulo(i*ratio(1), 1.0_wp), &
          & mod(k, 2) == 0)
        a = modulo(i*ratio(2), 1.0_wp)
        away(k, :) = [r*cos(a), r*sin(a), x(k, 3)]
        if (mod(k, 3) == 0) away(k, :2) = r*[cos(-0.02_wp - a), sin(-0.02_wp - a)]
      end do
      call expect_true(error, k == n, 'too few places')
      call places_in_mesh(mesh, shape%dim, x(:, :shape%dim), 0.0_wp, inside)
      call expect_true(error, all(inside), 'places in an arc of shape '//achar(48 + shapes(s)/10) &
        & //achar(48 + mod(shapes(s), 10)))
      call places_in_mesh(mesh, shape%dim, away(:, :shape%dim), 0.0_wp, inside)
      call expect_true(error, .not. any(inside), 'places beside an arc')
      if (allocated(error)) return
    end do
  end subroutine test_arcs

  subroutine points_of(text, body, scene, error)
    character(*), intent(in) :: text
    type(body_type), intent(out) :: body
    type(scene_type), intent(out) :: scene
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault
    real(wp) :: delta

    if (allocated(error)) return
    call read_scene_text(text, 'build/inside.nml', scene, fault)
    if (.not. allocated(fault)) call generate_body(scene, body, delta, fault)
    if (.not. allocated(fault)) call check_regions(scene, body, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine points_of

  !> Groups with a curved mesh in millimetres choose the points that an expression does.
  subroutine test_cuts(error)
    type(error_type), allocatable, intent(out) :: error
    type(sample_type) :: sample
    type(body_type) :: body, other
    type(scene_type) :: scene, same
    character(*), parameter :: mesh = "mesh = 'inside.msh' scale = 1e-3", &
      & formula = "where = '(y >= 0)*(y <= 1.5)*(x >= 0.2*y^2)*(x <= 3 + 0.2*y^2)'"
    character(6), parameter :: groups(3) = [character(6) :: 'keep', 'remove', 'refine']
    logical, allocatable :: mask(:)
    integer :: i

    call block_sample(8, [3, 2, 1], lengths, sample)
    do i = 1, sample%n_nodes
      sample%x(:, i) = 1000*moved(2, 0.2_wp, 0.0_wp, sample%x(:, i))
    end do
    call write_file('inside.msh', gmsh_text(sample, 2, .false., .false.))
    do i = 1, size(groups)
      call points_of(plane//'&'//trim(groups(i))//' '//mesh//' /', body, scene, error)
      call points_of(plane//'&'//trim(groups(i))//' '//formula//' /', other, same, error)
      if (allocated(error)) return
      call expect_true(error, body%n_points == other%n_points .and. body%n_points /= 2400, &
        & 'points with '//groups(i))
      if (body%n_points == other%n_points) call expect_close(error, body%x, other%x, 0.0_wp, &
        & groups(i))
      if (allocated(error)) return
    end do
    call points_of(plane//"&region name = 'a' "//mesh//" /"//lf//"&region name = 'b' "//formula// &
      & " /"//lf//"&region name = 'c' "//mesh//" where = 'x < 2' /"//lf//'&no_fail '//mesh//' /', &
      & body, scene, error)
    if (allocated(error)) return
    mask = in_region(scene, body, 1)
    call expect_true(error, all(mask .eqv. in_region(scene, body, 2)) .and. count(mask) > 400, &
      & 'a region')
    call expect_true(error, all(in_region(scene, body, 3) .eqv. (mask .and. body%x(:, 1) < 2)), &
      & 'a region with an expression')
    call expect_true(error, all(in_shape(scene, body, scene%no_fail(1)) .eqv. mask), &
      & 'where no bond breaks')
  end subroutine test_cuts

  subroutine test_refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(sample_type) :: sample

    call block_sample(11, [2, 2, 2], lengths, sample)
    sample%x(1, :sample%n_nodes) = -sample%x(1, :sample%n_nodes)
    call write_file('mirrored.msh', gmsh_text(sample, 2, .false., .false.))
    call block_sample(4, [2, 2, 1], lengths, sample)
    call write_file('inside.msh', gmsh_text(sample, 2, .false., .false.))
    call refuse("&remove mesh = 'inside.msh' shape = 'box' /", "'mesh' beside a shape")
    call refuse("&remove mesh = 'inside.msh' surface = 'a.stl' /", "'mesh' beside a surface")
    call refuse("&remove surface = 'a.stl' /", "a 'mesh' may have any dimension")
    call refuse("&keep mesh = 'no.msh' /", "cannot find the file 'no.msh'|inside.nml:5")
    call refuse("&keep shape = 'sphere' radius = 1 scale = 2 /", &
      & "'scale' without a surface or mesh")
    call refuse("&region name = 'r' mesh = 'mirrored.msh' /", &
      & 'in a scene of dimension 2|mirrored.msh')
    call refuse("&no_fail region = 'r' mesh = 'inside.msh' /", "'region' and 'mesh' are both given")
    call refuse("&keep mesh = 'inside.msh' scale = 1e-3 /", 'no points')
    if (allocated(error)) return
    call refuse_solid("&region name = 'r' mesh = 'mirrored.msh' /", &
      & 'is inverted|mirrored.msh')
    call refuse_solid("&no_fail mesh = 'inside.msh' /", &
      & 'no elements of dimension 3|inside.msh')

  contains

    subroutine refuse_solid(group, parts)
      character(*), intent(in) :: group, parts
      call refuse_text('&scene dimension = 3 /'//lf//'&body lower = 0, 0, 0 upper = 1, 1, 1 '// &
        & 'points = 4, 4, 4 /'//lf//"&define name = 'k' value = 1 /"//lf//group//lf//steel, parts)
    end subroutine refuse_solid

    subroutine refuse(group, parts)
      character(*), intent(in) :: group, parts
      call refuse_text(plane//group, parts)
    end subroutine refuse

    subroutine refuse_text(text, parts)
      character(*), intent(in) :: text, parts
      type(scene_type) :: scene
      type(body_type) :: body
      type(fault_type), allocatable :: fault
      real(wp) :: delta

      if (allocated(error)) return
      call read_scene_text(text, 'build/inside.nml', scene, fault)
      if (.not. allocated(fault)) call generate_body(scene, body, delta, fault)
      if (.not. allocated(fault)) call check_regions(scene, body, fault)
      call expect_parts(error, fault, parts)
    end subroutine refuse_text

  end subroutine test_refused

end module test_body_mesh_inside
