!> Values of fields between the points of a body (doc/theory.md, 14).
!>
!> A position takes its value from the nearest point and from the points that have an intact bond to
!> it: never from what lies behind a crack.
module pd_output_fields_between
  use pd_base_kinds, only: wp
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_interpolate, only: stencil_among, stencil_type
  implicit none (type, external)
  private
  public :: stencil_type, stencil_at, is_inside, values_between

contains

  !> Whether a position is in the bodies or at their surfaces: at most a spacing from its nearest
  !> point.
  pure logical function is_inside(system, nearest, position)
    type(system_type), intent(in) :: system
    integer, intent(in) :: nearest        !! slot of the point that is nearest to the position
    real(wp), intent(in) :: position(:)   !! (dim) [m]
    is_inside = norm2(system%body%x(nearest, :) - position) <= system%body%spacing(nearest)
  end function is_inside

  !> The slots and weights that give the value at a position by moving least squares, of second
  !> degree where the points allow it: exact for fields that are linear in x, at surfaces too.
  !> Outside of the bodies it is the nearest point alone.
  subroutine stencil_at(system, nearest, position, stencil)
    type(system_type), intent(in) :: system      !! with its intact bonds
    integer, intent(in) :: nearest               !! slot of the point nearest to the position
    real(wp), intent(in) :: position(:)          !! (dim) [m]
    type(stencil_type), intent(out) :: stencil   !! slots, and weights whose sum is 1
    type(bonds_type) :: bonds
    integer, allocatable :: slots(:)

    if (is_inside(system, nearest, position)) then
      call allocate_bonds(system%family, bonds)
      call system%family%bonds_of(nearest, bonds)
      slots = [nearest, pack(int(bonds%j(:bonds%n)), bonds%intact(:bonds%n))]
      call stencil_among(transpose(system%body%x(slots, :)), system%body%spacing(nearest), &
        & position, stencil)
      stencil%place = slots(stencil%place)
    else
      stencil%place = [nearest]
      stencil%weight = [1.0_wp]
    end if
  end subroutine stencil_at

  !> The values of a field at positions.
  subroutine values_between(field, now, stencils, values)
    type(output_field_type), intent(in) :: field
    type(moment_type), intent(in) :: now
    type(stencil_type), intent(in) :: stencils(:)   !! of `stencil_at` at this moment
    real(wp), intent(out) :: values(:, :)           !! (components, position)
    real(wp), allocatable :: of_slots(:, :)
    integer, allocatable :: slots(:)
    integer :: s, first, n

    allocate (slots(0))
    do s = 1, size(stencils)
      slots = [slots, stencils(s)%place]
    end do
    allocate (of_slots(size(values, 1), size(slots)))
    call field%values_at(now, slots, of_slots)
    first = 1
    do s = 1, size(stencils)
      n = size(stencils(s)%place)
      values(:, s) = matmul(of_slots(:, first:first + n - 1), stencils(s)%weight)
      first = first + n
    end do
  end subroutine values_between

end module pd_output_fields_between
