!> What must not be: points on top of each other. And what may surprise: points with no neighbour.
module pd_family_neighbours
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_reduce, only: count_of_ranks
  use pd_base_error, only: error_type, fail
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, number_at, owned
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  implicit none (type, external)
  private
  public :: check_overlap

  real(wp), parameter :: coincide = 1.0e-6_wp  !! distance of points that are one [spacings]

contains

  !> An error if two points coincide, of one body or of two; that lattices do not overlap has been
  !> seen before (`pd_body_overlap`). `isolated` is the number of points without any bond.
  subroutine check_overlap(body, family, isolated, error)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole or cut: broken bonds count as well
    integer, intent(out) :: isolated          !! points that are in no family
    type(error_type), allocatable, intent(out) :: error
    type(bonds_type) :: bonds
    integer(i4), allocatable :: other(:)
    integer(i1), allocatable :: alone(:)
    integer :: k, i, j

    isolated = 0
    allocate (other(body%n_slots), source=0_i4)
    allocate (alone(body%n_slots), source=0_i1)
    !$omp parallel default(none) shared(body, family, other, alone) private(bonds, k, i, j)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      ! alike slots have their members at the same distances
      if (family%alike(k) /= k) cycle
      call family%bonds_of(k, bonds)
      if (bonds%n == 0) alone(k) = 1_i1
      do i = 1, bonds%n
        j = bonds%j(i)
        if (bonds%length(i) < coincide*(body%spacing(k) + body%spacing(j))/2) other(k) = int(j, i4)
      end do
    end do
    !$omp end parallel
    do k = 1, body%n_slots
      if (.not. owned(body, k)) cycle
      if (alone(family%alike(k)) == 1_i1) isolated = isolated + 1
    end do
    isolated = int(count_of_ranks(body%order, int(isolated, i8)))
    if (all(other == 0_i4)) return
    ! the first of these points, whatever the slots; it is named first
    k = body%slot(minval(body%point, mask=other > 0_i4))
    j = other(k)
    if (body%body(k) /= body%body(j)) then
      call fail(error, 'points of bodies '//to_text(int(body%body(k)))//' and '// &
        & to_text(int(body%body(j)))//' coincide: '//at(k)//' and '//at(j), group='body', &
        & number=max(int(body%body(k)), int(body%body(j))))
    else
      call fail(error, 'two points of body '//to_text(int(body%body(k)))//' coincide: '//at(k)// &
        & ' and '//at(j), group='body', number=int(body%body(k)))
    end if

  contains

    !> A point's number and position.
    pure function at(s) result(text)
      integer, intent(in) :: s
      character(:), allocatable :: text
      integer :: c
      text = to_text(number_at(body, s))//' ('//to_text(body%x(s, 1))
      do c = 2, body%dim
        text = text//', '//to_text(body%x(s, c))
      end do
      text = text//')'
    end function at
  end subroutine check_overlap

end module pd_family_neighbours
