!> Large strains: the force of a bond is linear in its stretch, which no material is for long.
module pd_output_report_strain
  use pd_base_kinds, only: wp
  use pd_force_forces, only: energy_pass
  use pd_motion_watch_fault, only: greatest_stretch
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: large_strain, find_large_strains

  real(wp), parameter :: large_strain = 0.1_wp  !! of an intact bond [-]
  !> Part of the energy of a uniaxial stress at that strain which a point must hold before its bonds
  !> are checked, which takes long. Points at surfaces hold half of it, or less.
  real(wp), parameter :: suspicious = 0.25_wp

contains

  !> Points with an intact bond stretched or compressed by more than `large_strain`: their `number`,
  !> and the point with the largest one and its stretch; 0 without any.
  subroutine find_large_strains(system, number, point, stretch)
    type(system_type), intent(inout) :: system
    integer, intent(out) :: number, point
    real(wp), intent(out) :: stretch
    real(wp), allocatable :: energy(:)
    real(wp) :: this
    integer :: i, k

    allocate (energy(system%body%n_slots))
    call energy_pass(system%family, system%model, system%workspace, system%state%u, energy)
    number = 0
    point = 0
    stretch = 0.0_wp
    do i = 1, system%body%n_points
      k = system%body%slot(i)
      if (holds_then(system, k)) cycle
      if (energy(k) < suspicious*large_strain**2/2 &
        & *system%model%materials(system%body%material(k))%youngs_modulus) cycle
      this = greatest_stretch(system, k)
      if (abs(this) <= large_strain) cycle
      number = number + 1
      if (abs(this) <= abs(stretch)) cycle
      stretch = this
      point = i
    end do
  end subroutine find_large_strains

  !> Whether the bond law of a slot is one for large strains.
  pure logical function holds_then(system, k)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k

    holds_then = .false.
    if (allocated(system%model%laws)) &
      & holds_then = system%model%laws(system%body%material(k))%law%large_strains
  end function holds_then

end module pd_output_report_strain
