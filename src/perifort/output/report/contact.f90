!> There is no contact: separated or crushed pieces pass through each other. This searches for the
!> first pair of points that do, so that a run can say so.
module pd_output_report_contact
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type, gather
  use pd_family_cells, only: cells_type, sort_into_cells, neighbours_of
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  implicit none (type, external)
  private
  public :: touching_points

  real(wp), parameter :: too_close = 0.5_wp  !! [spacings]

contains

  !> Two points (numbers) that share no intact bond and are, at displacements `u` (n_slots, dim),
  !> closer than half their mean spacing: the pair with the lowest first point, or 0, 0.
  subroutine touching_points(body, family, u, first, second)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    real(wp), intent(in) :: u(:, :)
    integer, intent(out) :: first, second
    type(cells_type) :: cells
    type(bonds_type) :: bonds
    real(wp), allocatable :: y(:, :), half_reach(:)
    integer(i4), allocatable :: found(:), other(:)
    integer(i4) :: number
    integer :: i, m, j

    allocate (y(body%n_points, body%dim), half_reach(body%n_points), other(body%n_points))
    call gather(body, body%x + u, y)
    call gather(body, body%spacing, half_reach)
    half_reach = too_close*half_reach/2
    other = 0_i4
    call sort_into_cells(y, 2*maxval(half_reach), cells)
    !$omp parallel default(none) shared(body, family, y, half_reach, cells, other) &
    !$omp private(bonds, found, number, i, m, j)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 512)
    do i = 1, body%n_points
      call neighbours_of(y, half_reach, cells, i, number, found)
      if (number == 0) cycle
      call family%bonds_of(int(body%slot(i)), bonds)
      do m = 1, number
        j = body%slot(found(m))
        if (any(bonds%j(:bonds%n) == j .and. bonds%intact(:bonds%n))) cycle
        other(i) = found(m)
        exit
      end do
    end do
    !$omp end parallel
    first = findloc(other > 0, .true., dim=1)
    second = 0
    if (first > 0) second = other(first)
  end subroutine touching_points

end module pd_output_report_contact
