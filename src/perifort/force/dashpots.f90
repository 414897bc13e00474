!> Dashpots to the ground: forces against the velocities of points. Absorbing boundaries are made of
!> them (doc/theory.md, 10).
module pd_force_dashpots
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4
  use pd_force_term, only: force_term_type, no_stiffness, term_view_type
  implicit none (type, external)
  private
  public :: dashpots_type, new_dashpots

  !> The force density is -`damping` v, component by component.
  type, extends(force_term_type) :: dashpots_type
    integer(i4), allocatable :: slots(:)
    real(wp), allocatable :: damping(:, :)  !! (slots, dim) [N s/m4]
  contains
    procedure :: add_force
    procedure :: add_energy
    procedure :: add_stiffness_bound
    procedure :: add_damping_bound
    procedure :: keep
    procedure :: describe
  end type dashpots_type

contains

  !> Dashpots on some points.
  pure type(dashpots_type) function new_dashpots(slots, damping) result(dashpots)
    integer(i4), intent(in) :: slots(:)      !! (any number) on which they act
    real(wp), intent(in) :: damping(:, :)    !! (slots, dim) not negative [N s/m4]

    dashpots%name = 'dashpots'
    dashpots%conservative = .false.
    dashpots%tangent = no_stiffness
    dashpots%slots = slots
    dashpots%damping = damping
  end function new_dashpots

  !> The force density of the dashpots.
  subroutine add_force(self, view, force)
    class(dashpots_type), intent(in) :: self   !! the dashpots
    type(term_view_type), intent(in) :: view   !! whose velocities count
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    integer :: c, i, k

    do c = 1, size(force, 2)
      do i = 1, size(self%slots)
        k = self%slots(i)
        force(k, c) = force(k, c) - self%damping(i, c)*view%v(k, c)
      end do
    end do
  end subroutine add_force

  !> They store nothing.
  subroutine add_energy(self, view, density)
    class(dashpots_type), intent(in) :: self   !! the dashpots
    type(term_view_type), intent(in) :: view   !! of the body
    real(wp), intent(inout), contiguous :: density(:)
      !! (n_slots) energy density, left as it is [J/m3]
    call must_fit(self, view, density)
  end subroutine add_energy

  !> They have no stiffness.
  subroutine add_stiffness_bound(self, view, bound)
    class(dashpots_type), intent(in) :: self   !! the dashpots
    type(term_view_type), intent(in) :: view   !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, left as it is [N/m4]
    call must_fit(self, view, bound)
  end subroutine add_stiffness_bound

  !> The strongest direction of each point.
  subroutine add_damping_bound(self, view, bound)
    class(dashpots_type), intent(in) :: self   !! the dashpots
    type(term_view_type), intent(in) :: view   !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]
    integer :: i

    call must_fit(self, view, bound)
    do i = 1, size(self%slots)
      bound(self%slots(i)) = bound(self%slots(i)) + maxval(self%damping(i, :))
    end do
  end subroutine add_damping_bound

  !> The interface gives what dashpots have no use for; it must be of the body that they act on.
  subroutine must_fit(self, view, values)
    class(dashpots_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(in) :: values(:)

    if (size(self%slots) > size(values) .or. size(values) /= size(view%u, 1)) &
      & call internal_fault('dashpots on another body')
  end subroutine must_fit

  !> They carry nothing from one instant to the next.
  subroutine keep(self, archive)
    class(dashpots_type), intent(inout) :: self    !! the dashpots, left as they are
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read

    if (archive%reading .and. .not. allocated(self%slots)) call internal_fault('dashpots nowhere')
  end subroutine keep

  !> The scene's own lines describe them.
  function describe(self) result(text)
    class(dashpots_type), intent(in) :: self  !! the dashpots
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) text = 'dashpots nowhere'
  end function describe

end module pd_force_dashpots
