!> Outward surface areas of the points of lattices (doc/theory.md, 4): how a traction on the faces
!> of cells acts on their centres.
module pd_family_areas
  use pd_base_kinds, only: wp
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  implicit none (type, external)
  private
  public :: area_vectors, next_points, outermost_share, behind_share

  !> A face's area acts at its position by linear extrapolation from the two points behind it, which
  !> are half a spacing and one and a half away.
  real(wp), parameter :: outermost_share = 1.5_wp, behind_share = -0.5_wp

  real(wp), parameter :: same_place = 1.0e-6_wp  !! of points of a lattice [spacings]

contains

  !> The sum over regions of value x outward area vectors of their points (n_slots, dim): a region
  !> is all points of materials with the same value. A face of a cell without a neighbour gives 1.5
  !> of its area to its point, -0.5 to the point behind. At a face between regions the difference of
  !> their values acts in the same way on the points of both sides, parted by the sizes of the
  !> values: mostly on the stiffer side.
  !> With one value of 1 these are the A_k of the body: sum A_k = 0, sum A_k x_k^T = volume x
  !> identity. Families must be whole. `alone` is a slot with no neighbour on either side along an
  !> axis, whose faces have no second point; 0 if there is none.
  subroutine area_vectors(body, family, value, area, alone)
    type(body_type), intent(in) :: body       !! all on lattices, arranged in the family's slots
    class(family_type), intent(in) :: family  !! whole, with a reach of a spacing at least
    real(wp), intent(in) :: value(:)          !! (materials) of each material
    real(wp), allocatable, intent(out) :: area(:, :)
      !! (n_slots, dim) value x area [m2; m x thickness; cross section]
    integer, intent(out) :: alone             !! a slot without a second point, or 0
    type(bonds_type) :: bonds
    real(wp) :: face, part
    integer :: k, c, s, other, behind, a, before, ahead(-1:1, body%dim), next(-1:1, body%dim)
    logical :: inside, one_value

    alone = 0
    before = 0
    inside = .false.
    one_value = maxval(value) <= minval(value)
    allocate (area(body%n_slots, body%dim), source=0.0_wp)
    call allocate_bonds(family, bonds)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      ! in the next slot of a row the family mostly is alike
      a = family%alike(k)
      if (a /= before) then
        before = a
        call family%bonds_of(k, bonds)
        call next_points(body, bonds, k, next)
        ahead = merge(next - k, 0, next > 0)
        inside = all(next > 0)
      end if
      if (inside .and. one_value) cycle
      next = merge(k + ahead, 0, ahead /= 0)
      face = body%volume(k)/body%spacing(k)
      do c = 1, body%dim
        do s = -1, 1, 2
          other = next(s, c)
          part = value(body%material(k))
          if (other > 0) then
            associate (here => body%material(k), there => body%material(other))
              if (.not. abs(value(there) - value(here)) > 0.0_wp) cycle
              part = (value(here) - value(there))*abs(value(here))/(abs(value(here)) &
                & + abs(value(there)))
            end associate
          end if
          behind = next(-s, c)
          if (behind == 0) then
            alone = k
            return
          end if
          associate (outward => s*face*part)
            area(k, c) = area(k, c) + outermost_share*outward
            area(behind, c) = area(behind, c) + behind_share*outward
          end associate
        end do
      end do
    end do
  end subroutine area_vectors

  !> The slots of the next points of the same lattice along each axis, 0 where there is none.
  pure subroutine next_points(body, bonds, k, next)
    type(body_type), intent(in) :: body    !! arranged in slots
    type(bonds_type), intent(in) :: bonds  !! of slot `k`, in a whole family
    integer, intent(in) :: k               !! slot
    integer, intent(out) :: next(-1:, :)   !! (-1:1, dim) against and along each axis; (0, :) = `k`
    real(wp) :: limit
    integer :: i, c

    next = 0
    next(0, :) = k
    limit = ((1 + same_place)*body%spacing(k))**2
    do i = 1, bonds%n
      if (body%grid(bonds%j(i)) /= body%grid(k)) cycle
      if (sum(bonds%xi(i, :)**2) > limit) cycle
      c = maxloc(abs(bonds%xi(i, :)), dim=1)
      next(nint(sign(1.0_wp, bonds%xi(i, c))), c) = bonds%j(i)
    end do
  end subroutine next_points

end module pd_family_areas
