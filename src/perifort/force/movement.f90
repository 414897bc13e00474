!> How far points have moved since it was last searched what is near them: as long as that is less
!> than a search allowed for, nothing new can have come near.
module pd_force_movement
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type
  use pd_force_term, only: term_view_type
  implicit none (type, external)
  private
  public :: movement_type, new_movement, moved, remember_places, note_instant, is_noted

  !> Points, where they were at a search, and the instant for which that search is known to hold.
  type :: movement_type
    integer, allocatable :: runs(:, :)     !! (2, any number) first and last slots of runs of the
                                           !! points; between them may be slots without one
    real(wp), allocatable :: u(:, :)       !! (n_slots, dim) displacements at the search [m]
    integer :: searches = 0                !! so far
    logical :: noted = .false.             !! the search holds
    integer :: step = 0                    !! at the displacements of this step
    real(wp) :: time = 0.0_wp              !! and this time [s]
  end type movement_type

contains

  !> Of some points, not searched yet. What has no point never moves, so that runs go across it.
  subroutine new_movement(body, slots, movement)
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: slots(:)           !! of the points
    type(movement_type), intent(out) :: movement
    logical :: mine(body%n_slots)
    integer :: k, n, first

    mine = .false.
    mine(slots) = .true.
    allocate (movement%runs(2, size(slots)))
    n = 0
    first = 0
    do k = 1, body%n_slots
      if (mine(k)) then
        if (first == 0) then
          n = n + 1
          movement%runs(1, n) = k
          first = k
        end if
        movement%runs(2, n) = k
      else if (body%point(k) > 0) then
        first = 0
      end if
    end do
    movement%runs = movement%runs(:, :n)
  end subroutine new_movement

  !> Points are searched where they are.
  subroutine remember_places(movement, u)
    type(movement_type), intent(inout) :: movement
    real(wp), intent(in), contiguous :: u(:, :)   !! (n_slots, dim) displacements [m]

    movement%u = u
    movement%searches = movement%searches + 1
    movement%noted = .false.
  end subroutine remember_places

  !> The longest way of a point since the search [m].
  real(wp) function moved(movement, u) result(most)
    type(movement_type), intent(in) :: movement   !! searched
    real(wp), intent(in), contiguous :: u(:, :)   !! (n_slots, dim) displacements [m]
    integer :: r, k

    most = 0.0_wp
    !$omp parallel default(none) shared(movement, u) private(r, k) reduction(max:most)
    do r = 1, size(movement%runs, 2)
      associate (v => movement%u)
        select case (size(u, 2))
        case (1)
          !$omp do schedule(static)
          do k = movement%runs(1, r), movement%runs(2, r)
            most = max(most, (u(k, 1) - v(k, 1))**2)
          end do
          !$omp end do nowait
        case (2)
          !$omp do schedule(static)
          do k = movement%runs(1, r), movement%runs(2, r)
            most = max(most, (u(k, 1) - v(k, 1))**2 + (u(k, 2) - v(k, 2))**2)
          end do
          !$omp end do nowait
        case default
          !$omp do schedule(static)
          do k = movement%runs(1, r), movement%runs(2, r)
            most = max(most, (u(k, 1) - v(k, 1))**2 + (u(k, 2) - v(k, 2))**2 &
              & + (u(k, 3) - v(k, 3))**2)
          end do
          !$omp end do nowait
        end select
      end associate
    end do
    !$omp end parallel
    most = sqrt(most)
  end function moved

  !> Note that the search holds at an instant.
  pure subroutine note_instant(movement, view)
    type(movement_type), intent(inout) :: movement
    type(term_view_type), intent(in) :: view       !! the instant

    movement%noted = .true.
    movement%step = view%step
    movement%time = view%time
  end subroutine note_instant

  !> Whether it has been noted that the search holds at an instant.
  pure logical function is_noted(movement, view)
    type(movement_type), intent(in) :: movement
    type(term_view_type), intent(in) :: view       !! the instant

    is_noted = movement%noted .and. movement%step == view%step &
      & .and. .not. abs(movement%time - view%time) > 0.0_wp
  end function is_noted

end module pd_force_movement
