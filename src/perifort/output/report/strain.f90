!> Large strains: the force of a bond is linear in its stretch, which no material is for long.
module pd_output_report_strain
  use pd_base_kinds, only: wp
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_forces, only: energy_pass
  use pd_force_reference, only: bond_state_type, state_of_bond
  use pd_motion_watch_fault, only: greatest_stretch
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: large_strain, find_large_strains, find_strains_beyond

  real(wp), parameter :: large_strain = 0.1_wp  !! of an intact bond [-]
  !> Part of the energy of a uniaxial stress at that strain which a point must hold before its bonds
  !> are checked, which takes long. Points at surfaces hold half of it, or less.
  real(wp), parameter :: suspicious = 0.25_wp

contains

  !> Points with an intact bond stretched or compressed by more than `large_strain`: their `number`,
  !> and the point with the largest one and its stretch; 0 without any. Points whose law is one for
  !> large strains are left out.
  subroutine find_large_strains(system, number, point, stretch)
    type(system_type), intent(inout) :: system  !! at the present displacements
    integer, intent(out) :: number              !! of points
    integer, intent(out) :: point               !! the one with the largest stretch
    real(wp), intent(out) :: stretch            !! [-]
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
      if (energy_tells(system, k)) then
        if (energy(k) < suspicious*large_strain**2/2 &
          & *system%model%materials(system%body%material(k))%youngs_modulus) cycle
      end if
      this = greatest_stretch(system, k)
      if (abs(this) <= large_strain) cycle
      number = number + 1
      if (abs(this) <= abs(stretch)) cycle
      stretch = this
      point = i
    end do
  end subroutine find_large_strains

  !> Points whose law is one for large strains, with an intact bond whose logarithmic strain is
  !> beyond what the law is accurate for: their `number`, the point with the largest one, and that;
  !> 0 without any.
  subroutine find_strains_beyond(system, number, point, strain, limit)
    type(system_type), intent(in) :: system  !! at the present displacements
    integer, intent(out) :: number           !! of points
    integer, intent(out) :: point            !! the one with the largest strain
    real(wp), intent(out) :: strain          !! logarithmic [-]
    real(wp), intent(out) :: limit           !! of the law of that point [-]
    type(bonds_type) :: bonds
    real(wp) :: this
    integer :: i, k

    number = 0
    point = 0
    strain = 0.0_wp
    limit = huge(1.0_wp)
    if (.not. allocated(system%model%laws)) return
    call allocate_bonds(system%family, bonds)
    do i = 1, system%body%n_points
      k = system%body%slot(i)
      if (.not. holds_then(system, k)) cycle
      associate (law => system%model%laws(system%body%material(k))%law)
        if (law%accurate_to >= huge(1.0_wp)) cycle
        this = greatest_logarithm(system, k, bonds)
        if (abs(this) <= law%accurate_to) cycle
        number = number + 1
        if (abs(this) <= abs(strain)) cycle
        strain = this
        point = i
        limit = law%accurate_to
      end associate
    end do
  end subroutine find_strains_beyond

  !> The largest logarithmic strain, in size, of the intact bonds of a slot [-].
  real(wp) function greatest_logarithm(system, k, bonds) result(strain)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k
    type(bonds_type), intent(inout) :: bonds  !! room for them
    type(bond_state_type) :: bond
    real(wp) :: this
    integer :: i

    strain = 0.0_wp
    call system%family%bonds_of(k, bonds)
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      bond = state_of_bond(system%model, system%state%u, k, bonds, i)
      this = log(max(1 + bond%stretch, tiny(1.0_wp)))
      if (abs(this) > abs(strain)) strain = this
    end do
  end function greatest_logarithm

  !> Whether a point that is strained by much also stores much energy. One that has yielded or
  !> softened does not.
  pure logical function energy_tells(system, k)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k

    energy_tells = .true.
    if (.not. allocated(system%model%laws)) return
    associate (law => system%model%laws(system%body%material(k))%law)
      energy_tells = law%bond_history + law%point_history == 0
    end associate
  end function energy_tells

  !> Whether the bond law of a slot is one for large strains.
  pure logical function holds_then(system, k)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k

    holds_then = .false.
    if (allocated(system%model%laws)) &
      & holds_then = system%model%laws(system%body%material(k))%law%large_strains
  end function holds_then

end module pd_output_report_strain
