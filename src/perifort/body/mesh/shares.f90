!> Facets' areas shared among the points near them, so that a load on a surface acts on points.
!>
!> The weights of a facet sum up to 1 and have their centre at the facet's: they reproduce constants
!> and linear functions there. Over a closed surface of flat facets then sum A_k = 0 and
!> sum A_k x_k^T = volume times identity hold for the points, too. Weights come from a moving least
!> squares fit of degree 1 (Lancaster and Salkauskas, Math. Comput. 37 (1981) 141) over the elements
!> around the facet; behind the first row of points they may be negative.
module pd_body_mesh_shares
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4
  use pd_base_text, only: to_text
  use pd_body_mesh_around, only: around_type, elements_at_nodes, points_of, widen
  use pd_body_mesh_mesh, only: fault_of_file
  use pd_body_mesh_moments, only: fields_at, keep_sums, moments_type, number_of_fields, &
    & solve_moments, vector_at
  use pd_body_mesh_part, only: facets_type, outer_facets, part_type
  implicit none (type, external)
  private
  public :: share_areas, balance_areas, fit

  integer, parameter :: most_rings = 4          !! of elements around a facet
  real(wp), parameter :: good = 3.0_wp          !! sum of |weights| that needs no wider ring
  real(wp), parameter :: worst = 20.0_wp        !! beyond it there is no sound extrapolation

contains

  !> Area vectors and areas of points that stand for some facets. An error, with the place, if the
  !> body is but one point thick there, so that no weights reproduce linear functions.
  subroutine share_areas(part, x, facets, vector, area, error)
    type(part_type), intent(in) :: part                  !! with its faces
    real(wp), intent(in) :: x(:, :)                      !! (n_points, dim) its points [m]
    type(facets_type), intent(in) :: facets              !! of the part
    real(wp), allocatable, intent(out) :: vector(:, :)   !! (n_points, dim) along the normals [m2]
    real(wp), allocatable, intent(out) :: area(:)        !! (n_points) [m2]
    type(error_type), allocatable, intent(out) :: error
    type(around_type) :: around
    integer(i4), allocatable :: points(:)
    real(wp), allocatable :: weights(:), change(:, :)
    integer, allocatable :: mark(:)
    integer :: f, c, i

    allocate (vector(part%n_points, part%dim), area(part%n_points), source=0.0_wp)
    allocate (mark(part%mesh%n_elements), source=0)
    call elements_at_nodes(part, around)
    do f = 1, facets%n
      call weigh_facet(part, x, facets, f, around, mark, points, weights, error)
      if (allocated(error)) return
      if (allocated(part%moments)) then
        allocate (change(size(points), 1))
        do i = 1, size(points)
          change(i, 1) = dot_product(vector_at(part%moments, x(points(i), :)), &
            & facets%vector(:part%dim, f))
        end do
        call keep_sums(x(points, :), part%moments%linear, change)
        weights = weights + change(:, 1)
        deallocate (change)
      end if
      do c = 1, part%dim
        vector(points, c) = vector(points, c) + weights*facets%vector(c, f)
      end do
      area(points) = area(points) + weights*facets%area(f)
    end do
  end subroutine share_areas

  !> Find the small change of all facets' weights with which the points' areas have the moments that
  !> weights of bonds need (`pd_body_mesh_moments`): the least one that keeps the sums and, on flat
  !> facets, the centres of a facet's weights. `share_areas` takes it in from then on. An error if
  !> there is none.
  subroutine balance_areas(part, x, volume, error)
    type(part_type), intent(inout) :: part   !! with its faces; gets `moments`
    real(wp), intent(in) :: x(:, :)          !! (n_points, dim) its points [m]
    real(wp), intent(in) :: volume(:)        !! (n_points) [m3]
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: flat = 1.0e-9_wp  !! error of linear moments of flat facets [-]
    type(around_type) :: around
    type(facets_type) :: facets
    type(moments_type) :: moments
    integer(i4), allocatable :: points(:)
    real(wp), allocatable :: weights(:), matrix(:, :), right(:), w(:, :), divergence(:)
    real(wp), allocatable :: of_facet(:, :)
    integer, allocatable :: mark(:)
    integer :: f, i, n, pass

    if (allocated(part%moments)) deallocate (part%moments)
    n = number_of_fields(part%dim)
    moments%origin(:part%dim) = (minval(x, dim=1) + maxval(x, dim=1))/2
    moments%scale = max(maxval(maxval(x, dim=1) - minval(x, dim=1))/2, tiny(1.0_wp))
    allocate (w(part%dim, n), divergence(n), right(n), moments%multiplier(n))
    allocate (matrix(n, n), mark(part%mesh%n_elements))
    call outer_facets(part, facets)
    call elements_at_nodes(part, around)
    do pass = 1, 2
      right = 0.0_wp
      do i = 1, part%n_points
        call fields_at((x(i, :) - moments%origin(:part%dim))/moments%scale, w, divergence)
        right = right + volume(i)/moments%scale*divergence
      end do
      matrix = 0.0_wp
      mark = 0
      do f = 1, facets%n
        call weigh_facet(part, x, facets, f, around, mark, points, weights, error)
        if (allocated(error)) return
        allocate (of_facet(size(points), n))
        do i = 1, size(points)
          call fields_at((x(points(i), :) - moments%origin(:part%dim))/moments%scale, w, divergence)
          of_facet(i, :) = matmul(facets%vector(:part%dim, f), w)
        end do
        right = right - matmul(weights, of_facet)
        call keep_sums(x(points, :), moments%linear, of_facet)
        matrix = matrix + matmul(transpose(of_facet), of_facet)
        deallocate (of_facet)
      end do
      ! curved facets have other linear moments than their centres: these may change then, too
      associate (linear => right(:part%dim*(part%dim + 1)))
        if (maxval(abs(linear)) <= flat*sum(volume)/moments%scale) exit
      end associate
      moments%linear = .false.
    end do
    call solve_moments(matrix, right, moments%multiplier)
    if (maxval(abs(matmul(matrix, moments%multiplier) - right)) &
      & > 1.0e-9_wp*sum(volume)/moments%scale) then
      call fault_of_file(part%mesh, 'no surface areas of the points of this mesh have the '// &
        & "moments that surface_correction = 'consistent' needs", error, &
        & "use more elements, or surface_correction = 'energy'")
      return
    end if
    part%moments = moments
  end subroutine balance_areas

  !> The points that share a facet's area, and their weights.
  subroutine weigh_facet(part, x, facets, f, around, mark, points, weights, error)
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: x(:, :)
    type(facets_type), intent(in) :: facets
    integer, intent(in) :: f                            !! facet
    type(around_type), intent(in) :: around
    integer, intent(inout) :: mark(:)                   !! (elements) other numbers than f before
    integer(i4), allocatable, intent(out) :: points(:)
    real(wp), allocatable, intent(out) :: weights(:)    !! (points) [-]
    type(error_type), allocatable, intent(out) :: error
    integer(i4), allocatable :: elements(:), near(:)
    real(wp), allocatable :: tried(:)
    real(wp) :: least
    integer :: ring
    logical :: found

    least = worst
    elements = [part%faces(facets%face(f))%element(1)]
    mark(elements) = f
    do ring = 1, most_rings
      call widen(part, around, f, mark, elements)
      near = points_of(part, elements)
      call fit(x(near, :), facets%centre(:part%dim, f), tried, found)
      if (.not. found) cycle
      if (sum(abs(tried)) >= least) cycle
      least = sum(abs(tried))
      weights = tried
      points = near
      if (least <= good) exit
    end do
    if (least < worst) return
    call fault_of_file(part%mesh, 'the surface at '//place_text(facets%centre(:part%dim, f)) &
      & //' m has no points behind it that could share its load', error, &
      & 'the body is one element thick there: use more, or a lower dimension')
  end subroutine weigh_facet

  !> `(1, 2)`
  function place_text(x) result(text)
    real(wp), intent(in) :: x(:)
    character(:), allocatable :: text
    integer :: c

    text = '('//to_text(x(1))
    do c = 2, size(x)
      text = text//', '//to_text(x(c))
    end do
    text = text//')'
  end function place_text

  !> Weights of points that reproduce 1 and x at `at`, by moving least squares. `found` is false if
  !> the points lie in one plane, or on one line.
  pure subroutine fit(x, at, weights, found)
    real(wp), intent(in) :: x(:, :)                  !! (points, dim) [m]
    real(wp), intent(in) :: at(:)                    !! (dim) [m]
    real(wp), allocatable, intent(out) :: weights(:) !! (points) [-]
    logical, intent(out) :: found                    !! whether there are such weights
    real(wp), parameter :: singular = 1.0e-8_wp  !! square of an extent over that of all points
    real(wp) :: p(size(at) + 1, size(x, 1)), near(size(x, 1))
    real(wp) :: m(size(at) + 1, size(at) + 1), c(size(at) + 1), reach, scale
    integer :: i, k, n

    n = size(at) + 1
    p(1, :) = 1.0_wp
    do k = 2, n
      p(k, :) = x(:, k - 1) - at(k - 1)
    end do
    near = sum(p(2:, :)**2, dim=1)
    reach = maxval(near)
    p(2:, :) = p(2:, :)/sqrt(reach)
    near = 1/(near/reach + 0.05_wp)
    do k = 1, n
      do i = 1, n
        m(i, k) = sum(near*p(i, :)*p(k, :))
      end do
    end do
    ! Cholesky's factor, then both triangular systems for the right side (1, 0, ..)
    allocate (weights(size(x, 1)))
    found = .false.
    scale = m(1, 1)
    do k = 1, n
      do i = 1, k - 1
        m(k, i) = (m(k, i) - dot_product(m(k, :i - 1), m(i, :i - 1)))/m(i, i)
      end do
      c(k) = m(k, k) - sum(m(k, :k - 1)**2)
      if (c(k) <= singular*scale) return
      m(k, k) = sqrt(c(k))
    end do
    c = 0.0_wp
    c(1) = 1.0_wp
    do k = 1, n
      c(k) = (c(k) - dot_product(m(k, :k - 1), c(:k - 1)))/m(k, k)
    end do
    do k = n, 1, -1
      c(k) = (c(k) - dot_product(m(k + 1:, k), c(k + 1:)))/m(k, k)
    end do
    weights = near*matmul(c, p)
    found = .true.
  end subroutine fit

end module pd_body_mesh_shares
