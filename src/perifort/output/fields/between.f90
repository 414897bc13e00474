!> Values of fields between the points of a body (doc/theory.md, 14).
!>
!> A position takes its value from the nearest point and from the points that have an intact bond to
!> it: never from what lies behind a crack. Of several ranks the one that owns the nearest point
!> finds these points; their owners tell all ranks the values.
module pd_output_fields_between
  use pd_base_kinds, only: wp, i8
  use pd_base_order, only: owned_point
  use pd_body_body, only: body_type, number_at
  use pd_body_shapes, only: touch
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_interpolate, only: stencil_among, stencil_type
  implicit none (type, external)
  private
  public :: stencil_type, stencil_at, is_inside
  public :: spots_type, choose_ranks, find_spots, values_at_spots

  !> Where values at positions come from, alike on all ranks but for the slots.
  type :: spots_type
    integer, allocatable :: first(:)       !! place of each position's first point in the lists, and
                                           !! one past the last
    integer, allocatable :: slot(:)        !! of the points, 0: another rank owns it
    real(wp), allocatable :: weight(:)     !! of their values
    logical, allocatable :: inside(:)      !! (positions) in the bodies or at their surfaces
  end type spots_type

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

  !> Whether the point that is nearest to a position, of those of all ranks, is here; ties go to the
  !> lowest number. All ranks call it together.
  subroutine choose_ranks(body, nearest, positions, here)
    type(body_type), intent(in) :: body             !! arranged in slots
    integer, intent(in) :: nearest(:)               !! slot of the owned point nearest to each
    real(wp), intent(in) :: positions(:, :)         !! (position, dim) [m]
    logical, allocatable, intent(out) :: here(:)    !! (position)
    real(wp) :: distance(size(nearest)), least(size(nearest)), lowest(size(nearest))
    integer :: p

    allocate (here(size(nearest)), source=.true.)
    if (.not. associated(body%order%ranks)) return
    distance = [(norm2(body%x(nearest(p), :) - positions(p, :)), p=1, size(nearest))]
    least = -distance
    call body%order%ranks%take_largest(least)
    least = -least
    ! numbers of points are exact as reals
    lowest = -real(body%order%n_global + 1_i8, wp)
    where (distance <= least + touch*body%spacing(nearest)) &
      & lowest = -real(number_at(body, nearest), wp)
    call body%order%ranks%take_largest(lowest)
    here = nint(-lowest, i8) == number_at(body, nearest)
  end subroutine choose_ranks

  !> Find where the values at positions come from, with the bonds that are intact now. All ranks
  !> call it together.
  subroutine find_spots(system, nearest, here, positions, spots)
    type(system_type), intent(in) :: system      !! with its intact bonds
    integer, intent(in) :: nearest(:)            !! slot of the owned point nearest to each position
    logical, intent(in) :: here(:)               !! of all ranks this one has the nearest
    real(wp), intent(in) :: positions(:, :)      !! (position, dim) [m]
    type(spots_type), intent(out) :: spots       !! ready for `values_at_spots`
    type(stencil_type) :: stencils(size(nearest))
    real(wp), allocatable :: message(:)
    integer :: p, n

    n = size(nearest)
    allocate (message(2*n), source=0.0_wp)
    do p = 1, n
      if (.not. here(p)) cycle
      call stencil_at(system, nearest(p), positions(p, :), stencils(p))
      message(p) = real(size(stencils(p)%place), wp)
      if (is_inside(system, nearest(p), positions(p, :))) message(n + p) = 1.0_wp
    end do
    associate (order => system%body%order)
      ! the other ranks add zeros
      call add_everywhere(system%body, message)
      spots%inside = message(n + 1:) > 0.5_wp
      allocate (spots%first(n + 1))
      spots%first(1) = 1
      do p = 1, n
        spots%first(p + 1) = spots%first(p) + nint(message(p))
      end do
      deallocate (message)
      n = spots%first(n + 1) - 1
      allocate (message(2*n), source=0.0_wp)
      do p = 1, size(nearest)
        if (.not. here(p)) cycle
        message(spots%first(p):spots%first(p + 1) - 1) = real(number_at(system%body, &
          & stencils(p)%place), wp)
        message(n + spots%first(p):n + spots%first(p + 1) - 1) = stencils(p)%weight
      end do
      call add_everywhere(system%body, message)
      spots%weight = message(n + 1:)
      allocate (spots%slot(n), source=0)
      do p = 1, n
        associate (point => owned_point(order, nint(message(p), i8)))
          if (point > 0) spots%slot(p) = int(system%body%slot(point))
        end associate
      end do
    end associate
  end subroutine find_spots

  !> Add numbers over all ranks.
  subroutine add_everywhere(body, numbers)
    type(body_type), intent(in) :: body
    real(wp), intent(inout) :: numbers(:)
    if (associated(body%order%ranks)) call body%order%ranks%add_all(numbers)
  end subroutine add_everywhere

  !> The values of a field at positions, on all ranks. All of them call it together.
  subroutine values_at_spots(field, now, spots, values)
    type(output_field_type), intent(in) :: field
    type(moment_type), intent(in) :: now
    type(spots_type), intent(in) :: spots    !! of `find_spots` at this moment
    real(wp), intent(out) :: values(:, :)    !! (components, position)
    real(wp) :: of_points(size(values, 1)*size(spots%slot))
    real(wp), allocatable :: of_slots(:, :)
    integer, allocatable :: places(:)
    integer :: p, i, n

    n = size(values, 1)
    places = pack([(i, i=1, size(spots%slot))], spots%slot > 0)
    of_points = 0.0_wp
    if (size(places) > 0) then
      allocate (of_slots(n, size(places)))
      call field%values_at(now, spots%slot(places), of_slots)
      do i = 1, size(places)
        of_points((places(i) - 1)*n + 1:places(i)*n) = of_slots(:, i)
      end do
    end if
    call add_everywhere(now%system%body, of_points)
    of_slots = reshape(of_points, [n, size(spots%slot)])
    do p = 1, size(values, 2)
      associate (first => spots%first(p), last => spots%first(p + 1) - 1)
        values(:, p) = matmul(of_slots(:, first:last), spots%weight(first:last))
      end associate
    end do
  end subroutine values_at_spots

end module pd_output_fields_between
