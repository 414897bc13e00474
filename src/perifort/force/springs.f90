!> Springs to the ground: points are pulled back to where they were at the start, component by
!> component.
module pd_force_springs
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i4
  use pd_force_term, only: force_term_type, has_tangent, term_view_type
  implicit none (type, external)
  private
  public :: springs_type, new_springs

  !> The force density is -`stiffness` u.
  type, extends(force_term_type) :: springs_type
    integer(i4), allocatable :: slots(:)
    real(wp) :: stiffness(3) = 0.0_wp  !! per volume of the points [N/m4]
  contains
    procedure :: add_force
    procedure :: add_energy
    procedure :: add_stiffness_bound
    procedure :: add_tangent
    procedure :: keep
    procedure :: describe
  end type springs_type

contains

  !> Springs on some points.
  pure type(springs_type) function new_springs(slots, stiffness) result(springs)
    integer(i4), intent(in) :: slots(:)    !! (any number) on which they act
    real(wp), intent(in) :: stiffness(:)   !! (dim) per volume of the points, not negative [N/m4]

    springs%name = 'springs'
    springs%tangent = has_tangent
    springs%slots = slots
    springs%stiffness(:size(stiffness)) = stiffness
  end function new_springs

  !> The force density of the springs.
  subroutine add_force(self, view, force)
    class(springs_type), intent(in) :: self    !! the springs
    type(term_view_type), intent(in) :: view   !! whose displacements count
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    integer :: c, i, k

    do c = 1, size(force, 2)
      do i = 1, size(self%slots)
        k = self%slots(i)
        force(k, c) = force(k, c) - self%stiffness(c)*view%u(k, c)
      end do
    end do
  end subroutine add_force

  !> Half the stiffness times the square of the displacement.
  subroutine add_energy(self, view, density)
    class(springs_type), intent(in) :: self    !! the springs
    type(term_view_type), intent(in) :: view   !! whose displacements count
    real(wp), intent(inout), contiguous :: density(:)
      !! (n_slots) energy density, added to [J/m3]
    integer :: c, i, k

    do c = 1, size(view%u, 2)
      do i = 1, size(self%slots)
        k = self%slots(i)
        density(k) = density(k) + self%stiffness(c)*view%u(k, c)**2/2
      end do
    end do
  end subroutine add_energy

  !> The stiffest direction.
  subroutine add_stiffness_bound(self, view, bound)
    class(springs_type), intent(in) :: self    !! the springs
    type(term_view_type), intent(in) :: view   !! of the body
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, added to [N/m4]
    integer :: i

    do i = 1, size(self%slots)
      bound(self%slots(i)) = bound(self%slots(i)) + maxval(self%stiffness(:view%body%dim))
    end do
  end subroutine add_stiffness_bound

  !> What the springs resist.
  subroutine add_tangent(self, view, w, kw)
    class(springs_type), intent(in) :: self      !! the springs
    type(term_view_type), intent(in) :: view     !! of the body
    real(wp), intent(in), contiguous :: w(:, :)  !! (n_slots, dim) small displacement [m]
    real(wp), intent(inout), contiguous :: kw(:, :)
      !! (n_slots, dim) resistance to it, added to [N/m3]
    integer :: c, i, k

    do c = 1, view%body%dim
      do i = 1, size(self%slots)
        k = self%slots(i)
        kw(k, c) = kw(k, c) + self%stiffness(c)*w(k, c)
      end do
    end do
  end subroutine add_tangent

  !> They carry nothing from one instant to the next.
  subroutine keep(self, archive)
    class(springs_type), intent(inout) :: self     !! the springs, left as they are
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read

    if (archive%reading .and. .not. allocated(self%slots)) call internal_fault('springs nowhere')
  end subroutine keep

  !> The scene's own lines describe them.
  function describe(self) result(text)
    class(springs_type), intent(in) :: self  !! the springs
    character(:), allocatable :: text

    text = ''
    if (.not. allocated(self%slots)) text = 'springs nowhere'
  end function describe

end module pd_force_springs
