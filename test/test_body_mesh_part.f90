!> Points and facets of meshes against closed forms.
module test_body_mesh_part
  use pd_base_error, only: fault_type => error_type
  use pd_base_kinds, only: wp
  use pd_body_mesh_elements, only: shape_numbered, shape_type
  use pd_body_mesh_geometry, only: mesh_points
  use pd_body_mesh_part, only: facets_type, find_faces, outer_facets, part_type
  use pd_body_mesh_quadrature, only: counts_of_kind
  use pd_body_mesh_read, only: read_mesh_text
  use testdrive, only: error_type, new_unittest, test_failed, unittest_type
  use bodies, only: expect_true
  use comparisons, only: expect_close
  use meshes, only: block_sample, gmsh_text, sample_type
  implicit none (type, external)
  private
  public :: collect_body_mesh_part

  real(wp), parameter :: lengths(3) = [3.0_wp, 1.5_wp, 0.8_wp]

contains

  subroutine collect_body_mesh_part(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('volume and centre of a block of every shape', test_blocks), &
      & new_unittest('inertia of a block by Gauss points', test_inertia), &
      & new_unittest('volume and centre of curved elements', test_curved), &
      & new_unittest('a rule that a shape does not have is refused', test_no_rule), &
      & new_unittest('facets close every block', test_closed)]
  end subroutine collect_body_mesh_part

  subroutine make(number, counts, bend, part, error)
    integer, intent(in) :: number, counts(3)
    real(wp), intent(in) :: bend               !! x grows by bend y^2
    type(part_type), intent(out) :: part
    type(error_type), allocatable, intent(inout) :: error
    type(sample_type) :: sample
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text

    call block_sample(number, counts, lengths, sample)
    sample%x(1, :sample%n_nodes) = sample%x(1, :sample%n_nodes) &
      & + bend*sample%x(2, :sample%n_nodes)**2
    text = gmsh_text(sample, 4, .true., .false.)
    part%dim = sample%dim
    call read_mesh_text(text, 'a.msh', part%dim, 1.0_wp, part%mesh, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine make

  subroutine points(part, per_element, depth, x, volume, error)
    type(part_type), intent(inout) :: part
    integer, intent(in) :: per_element
    real(wp), intent(in) :: depth
    real(wp), allocatable, intent(out) :: x(:, :), volume(:)
    type(error_type), allocatable, intent(inout) :: error
    type(fault_type), allocatable :: fault

    call mesh_points(part%mesh, part%dim, per_element, depth, x, volume, part%element, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    part%n_points = size(volume)
  end subroutine points

  subroutine test_blocks(error)
    type(error_type), allocatable, intent(out) :: error
    type(part_type) :: part
    type(shape_type) :: shape
    real(wp), allocatable :: x(:, :), volume(:)
    integer, allocatable :: counts(:)
    real(wp) :: whole
    integer :: s, r

    do s = 2, 16
      shape = shape_numbered(s)
      call make(s, [3, 2, 2], 0.0_wp, part, error)
      if (allocated(error)) return
      counts = [1, counts_of_kind(shape%kind)]
      whole = 0.7_wp*product(lengths(:shape%dim))
      do r = 1, size(counts)
        call points(part, counts(r), 0.7_wp, x, volume, error)
        if (allocated(error)) return
        call expect_close(error, [sum(volume), matmul(volume, x)], [whole, &
          & whole*lengths(:shape%dim)/2], 1.0e-13_wp, 'a block of '//trim(shape%name)//'s')
        call expect_true(error, all(volume > 0.0_wp), 'positive volumes')
      end do
    end do
  end subroutine test_blocks

  !> Rules of degree 2 and more have all second moments of straight elements.
  subroutine test_inertia(error)
    type(error_type), allocatable, intent(out) :: error
    type(part_type) :: part
    type(shape_type) :: shape
    real(wp), allocatable :: x(:, :), volume(:), expected(:, :), moments(:, :)
    integer, allocatable :: counts(:)
    real(wp) :: whole
    integer :: s, r, i, j

    do s = 2, 16
      shape = shape_numbered(s)
      call make(s, [2, 2, 1], 0.0_wp, part, error)
      counts = counts_of_kind(shape%kind)
      whole = product(lengths(:shape%dim))
      do r = 1, size(counts)
        call points(part, counts(r), 1.0_wp, x, volume, error)
        if (allocated(error)) return
        allocate (expected(shape%dim, shape%dim), moments(shape%dim, shape%dim))
        do i = 1, shape%dim
          do j = 1, shape%dim
            expected(i, j) = whole*lengths(i)*lengths(j)/merge(3, 4, i == j)
            moments(i, j) = sum(volume*x(:, i)*x(:, j))
          end do
        end do
        call expect_close(error, moments, expected, 1.0e-12_wp, 'moments of '//trim(shape%name))
        deallocate (expected, moments)
      end do
    end do
  end subroutine test_inertia

  !> x + 0.3 y^2 keeps volumes and moves the centre by 0.3 L^2/3; elements of degree 2 are exact.
  subroutine test_curved(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: shapes(*) = [5, 7, 8, 10, 12, 13, 15]
    type(part_type) :: part
    type(shape_type) :: shape
    type(facets_type) :: facets
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: x(:, :), volume(:)
    real(wp) :: whole, centre(3)
    integer :: s

    do s = 1, size(shapes)
      shape = shape_numbered(shapes(s))
      call make(shapes(s), [2, 2, 1], 0.3_wp, part, error)
      if (.not. allocated(error)) call points(part, 1, 1.0_wp, x, volume, error)
      if (allocated(error)) return
      whole = product(lengths(:shape%dim))
      centre = lengths/2
      centre(1) = centre(1) + 0.3_wp*lengths(2)**2/3
      call expect_close(error, [sum(volume), matmul(volume, x)], [whole, &
        & whole*centre(:shape%dim)], 1.0e-13_wp, 'curved '//trim(shape%name)//'s')
      call find_faces(part, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      call outer_facets(part, facets)
      call expect_close(error, sum(facets%vector, dim=2), [0.0_wp, 0.0_wp, 0.0_wp], 1.0e-13_wp, &
        & 'the sum of areas of curved facets')
    end do
  end subroutine test_curved

  subroutine test_no_rule(error)
    type(error_type), allocatable, intent(out) :: error
    type(part_type) :: part
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: x(:, :), volume(:)

    call make(11, [1, 1, 1], 0.0_wp, part, error)
    if (allocated(error)) return
    call mesh_points(part%mesh, 3, 4, 1.0_wp, x, volume, part%element, fault)
    if (.not. allocated(fault)) then
      call test_failed(error, 'hexahedra with 4 points')
    else
      call expect_true(error, index(fault%message, 'it may have 1 or 8 or 27') > 0, fault%message)
    end if
  end subroutine test_no_rule

  !> Sum A = 0 and sum A x^T = volume times identity (the divergence theorem on flat facets).
  subroutine test_closed(error)
    type(error_type), allocatable, intent(out) :: error
    type(part_type) :: part
    type(shape_type) :: shape
    type(facets_type) :: facets
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: x(:, :), volume(:)
    real(wp) :: moment(3, 3), expected(3, 3)
    integer :: s, i

    do s = 2, 16
      shape = shape_numbered(s)
      call make(s, [3, 2, 1], 0.0_wp, part, error)
      part%depth = 0.7_wp
      if (.not. allocated(error)) call points(part, 1, part%depth, x, volume, error)
      if (allocated(error)) return
      call find_faces(part, fault)
      if (allocated(fault)) call test_failed(error, fault%message)
      call outer_facets(part, facets)
      moment = matmul(facets%vector, transpose(facets%centre))
      expected = 0.0_wp
      do i = 1, shape%dim
        expected(i, i) = sum(volume)
      end do
      call expect_close(error, sum(facets%vector, dim=2), [0.0_wp, 0.0_wp, 0.0_wp], 1.0e-13_wp, &
        & 'sum of areas')
      call expect_close(error, moment, expected, 1.0e-13_wp, 'the surface of '//trim(shape%name) &
        & //'s')
    end do
  end subroutine test_closed

end module test_body_mesh_part
