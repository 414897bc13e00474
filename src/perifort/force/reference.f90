!> The theory as it is written, point by point on `bonds_of`: the oracle of every fast loop, and the
!> tool for single points (breaking, output), where speed doesn't matter.
module pd_force_reference
  use pd_base_kinds, only: wp
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_family_surface, only: bond_factor
  use pd_force_model, only: bond_factors_of, model_type, p_of, q_of, t_of
  implicit none (type, external)
  private
  public :: bond_state_type, state_of_bond, stretch_of_bond, point_dilatation, point_force
  public :: point_energy, energy_product, energies_of_loss, point_damage
  public :: reference_dilatation, reference_force, reference_energy

  !> How a bond is deformed.
  type :: bond_state_type
    real(wp) :: stretch = 0.0_wp       !! mechanical: without thermal expansion [-]
    real(wp) :: direction(3) = 0.0_wp  !! unit vector of the deformed bond
    real(wp) :: lambda = 1.0_wp        !! its cosine with the undeformed one, 1 if unprojected
    real(wp) :: Gd = 1.0_wp            !! surface factors times those of the law
    real(wp) :: Gb = 1.0_wp
  end type bond_state_type

contains

  !> State of the `i`-th bond of slot `k` under displacements `u` (n_slots, dim) [m].
  pure function state_of_bond(model, u, k, bonds, i, expansion) result(state)
    type(model_type), intent(in) :: model  !! parameters of the slots
    real(wp), intent(in) :: u(:, :)        !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k               !! slot
    type(bonds_type), intent(in) :: bonds  !! of slot `k`
    integer, intent(in) :: i               !! number of the bond, from 1
    real(wp), intent(in), optional :: expansion(:)
      !! (n_slots) thermal strains; those of the model by default [-]
    type(bond_state_type) :: state
    real(wp) :: n(3), deformed(3), length, y, gb, gd
    integer :: dim, j

    j = bonds%j(i)
    length = bonds%length(i)
    dim = size(u, 2)
    n(:dim) = bonds%xi(i, :dim)/length
    call deform(u, k, bonds, i, deformed, y, state%stretch)
    ! a bond crushed to a point has no direction: no force rather than NaN
    if (y > 0.0_wp) state%direction = deformed/y
    if (model%projected) state%lambda = dot_product(state%direction(:dim), n(:dim))
    if (present(expansion)) then
      state%stretch = state%stretch - (expansion(k) + expansion(j))/2
    else if (model%thermal) then
      state%stretch = state%stretch - (model%expansion(k) + model%expansion(j))/2
    end if
    if (model%surface) then
      state%Gd = bond_factor(n(:dim), model%D(k, :), model%D(j, :), model%axes)
      state%Gb = bond_factor(n(:dim), model%S(k, :), model%S(j, :), model%axes)
    end if
    if (model%consistent) then
      associate (place => model%weights%before(k) + i)
        state%Gd = model%weights%Gd(place)
        state%Gb = model%weights%Gb(place)
      end associate
    end if
    if (model%weighted) then
      call bond_factors_of(model, k, j, length, gb, gd)
      state%Gd = state%Gd*gd
      state%Gb = state%Gb*gb
    end if
  end function state_of_bond

  !> The mechanical stretch alone [-].
  pure real(wp) function stretch_of_bond(model, u, k, bonds, i) result(stretch)
    type(model_type), intent(in) :: model  !! parameters of the slots
    real(wp), intent(in) :: u(:, :)        !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k               !! slot
    type(bonds_type), intent(in) :: bonds  !! of slot `k`
    integer, intent(in) :: i               !! number of the bond, from 1
    real(wp) :: deformed(3), y
    integer :: j

    j = bonds%j(i)
    call deform(u, k, bonds, i, deformed, y, stretch)
    if (model%thermal) stretch = stretch - (model%expansion(k) + model%expansion(j))/2
  end function stretch_of_bond

  !> The deformed bond, its length, and its stretch, which is formed without cancellation
  !> (doc/theory.md, 2).
  pure subroutine deform(u, k, bonds, i, deformed, y, stretch)
    real(wp), intent(in) :: u(:, :)
    integer, intent(in) :: k, i
    type(bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: deformed(3), y, stretch
    real(wp) :: eta, length, along, squared
    integer :: c, j

    length = bonds%length(i)
    j = bonds%j(i)
    deformed = 0.0_wp
    along = 0.0_wp
    squared = 0.0_wp
    do c = 1, size(u, 2)
      eta = u(j, c) - u(k, c)
      deformed(c) = bonds%xi(i, c) + eta
      along = along + bonds%xi(i, c)*eta
      squared = squared + eta*eta
    end do
    y = norm2(deformed)
    stretch = (2*along + squared)/(length*(y + length))
  end subroutine deform

  !> theta of slot `k` (7.39).
  pure real(wp) function point_dilatation(model, u, k, bonds) result(theta)
    type(model_type), intent(in) :: model  !! parameters of the slots
    real(wp), intent(in) :: u(:, :)        !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k               !! slot
    type(bonds_type), intent(in) :: bonds  !! of slot `k`; broken ones count nothing
    type(bond_state_type) :: state
    integer :: i

    theta = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      state = state_of_bond(model, u, k, bonds, i)
      theta = theta + state%Gd*state%stretch*state%lambda*bonds%weight(i)
    end do
    theta = theta*t_of(model, k)
  end function point_dilatation

  !> Force density of slot `k` [N/m3] (7.37, 7.38) from the coefficients p_k = 2 a d delta theta_k.
  pure function point_force(model, u, p, k, bonds) result(force)
    type(model_type), intent(in) :: model  !! parameters of the slots
    real(wp), intent(in) :: u(:, :)        !! (n_slots, dim) displacements [m]
    real(wp), intent(in) :: p(:)           !! (n_slots) coefficients of the dilatation [N/m5]
    integer, intent(in) :: k               !! slot
    type(bonds_type), intent(in) :: bonds  !! of slot `k`; broken ones count nothing
    real(wp) :: force(size(u, 2))
    type(bond_state_type) :: state
    real(wp) :: magnitude
    integer :: i, j

    force = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      j = bonds%j(i)
      state = state_of_bond(model, u, k, bonds, i)
      magnitude = (q_of(model, k) + q_of(model, j))*state%Gb*state%stretch
      if (model%dilatation) &
        & magnitude = magnitude + (p(k) + p(j))*state%Gd*state%lambda/bonds%length(i)
      force = force + magnitude*bonds%weight(i)*state%direction(:size(u, 2))
    end do
  end function point_force

  !> Strain energy density W of slot `k` [J/m3] (doc/theory.md, 9).
  pure real(wp) function point_energy(model, u, k, bonds) result(energy)
    type(model_type), intent(in) :: model     !! parameters of the slots
    real(wp), intent(in) :: u(:, :)           !! displacements (n_slots, dim) [m]
    integer, intent(in) :: k                  !! slot
    type(bonds_type), intent(in) :: bonds     !! of slot `k`
    energy = energy_product(model, u, u, k, bonds)
  end function point_energy

  !> The strain energy density W of slot `k` with the products of the stretches, and of the
  !> dilatations, of two instants in place of the squares [J/m3] (doc/theory.md, 9).
  pure real(wp) function energy_product(model, u, other, k, bonds) result(energy)
    type(model_type), intent(in) :: model     !! parameters of the slots
    real(wp), intent(in) :: u(:, :)           !! displacements of one instant (n_slots, dim) [m]
    real(wp), intent(in) :: other(:, :)       !! of the other; read at `k` and at its bonds' ends
    integer, intent(in) :: k                  !! slot
    type(bonds_type), intent(in) :: bonds     !! of slot `k`
    type(bond_state_type) :: state, state_of_other
    integer :: i

    energy = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      state = state_of_bond(model, u, k, bonds, i)
      state_of_other = state_of_bond(model, other, k, bonds, i)
      energy = energy + state%Gb*(state%stretch*state_of_other%stretch)*bonds%length(i) &
        & *bonds%weight(i)
    end do
    associate (m => model%materials(model%material(k)))
      energy = q_of(model, k)/2*energy
      if (abs(m%a) > 0.0_wp) energy = energy + m%a*point_dilatation(model, u, k, bonds) &
        & *point_dilatation(model, other, k, bonds)
    end associate
  end function energy_product

  !> Energy densities of slot `k` [J/m3] before and after some of its bonds break: `energy_product`
  !> of `u` with itself, and with each set of `others`. Each bond's states are found once.
  pure subroutine energies_of_loss(model, u, k, bonds, breaks, before, after, others, expansions)
    type(model_type), intent(in) :: model              !! parameters of the slots
    real(wp), intent(in) :: u(:, :)                    !! displacements (n_slots, dim) [m]
    integer, intent(in) :: k                           !! slot
    type(bonds_type), intent(in) :: bonds              !! of slot `k`, as they were
    logical, intent(in) :: breaks(:)                   !! (bonds) those that break
    real(wp), intent(out) :: before(0:), after(0:)     !! (0:sets) [J/m3]
    real(wp), intent(in), optional :: others(:, :, :)
      !! (n_slots, dim, sets) other displacements, read at `k` and at the ends of its bonds [m]
    real(wp), intent(in), optional :: expansions(:, :)
      !! (n_slots, sets) thermal strains with each of them; those of the model by default [-]
    type(bond_state_type) :: own, state
    real(wp) :: theta(2, 0:ubound(before, 1)), energy, dilatation
    integer :: i, o

    before = 0.0_wp
    after = 0.0_wp
    theta = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      own = state_of_bond(model, u, k, bonds, i)
      state = own
      do o = 0, ubound(before, 1)
        if (o > 0 .and. present(expansions)) then
          state = state_of_bond(model, others(:, :, o), k, bonds, i, expansions(:, o))
        else if (o > 0) then
          state = state_of_bond(model, others(:, :, o), k, bonds, i)
        end if
        energy = own%Gb*(own%stretch*state%stretch)*bonds%length(i)*bonds%weight(i)
        dilatation = state%Gd*state%stretch*state%lambda*bonds%weight(i)
        before(o) = before(o) + energy
        theta(1, o) = theta(1, o) + dilatation
        if (breaks(i)) cycle
        after(o) = after(o) + energy
        theta(2, o) = theta(2, o) + dilatation
      end do
    end do
    theta = theta*t_of(model, k)
    associate (m => model%materials(model%material(k)))
      before = q_of(model, k)/2*before
      after = q_of(model, k)/2*after
      if (.not. abs(m%a) > 0.0_wp) return
      do o = 0, ubound(before, 1)
        before(o) = before(o) + m%a*theta(1, 0)*theta(1, o)
        after(o) = after(o) + m%a*theta(2, 0)*theta(2, o)
      end do
    end associate
  end subroutine energies_of_loss

  !> Local damage phi of a point [-]: the part of its family's volume behind broken bonds, 0 without
  !> bonds.
  pure real(wp) function point_damage(bonds) result(damage)
    type(bonds_type), intent(in) :: bonds  !! of the point, broken ones included
    real(wp) :: whole, lost
    integer :: i

    whole = 0.0_wp
    lost = 0.0_wp
    do i = 1, bonds%n
      whole = whole + bonds%weight(i)
      if (.not. bonds%intact(i)) lost = lost + bonds%weight(i)
    end do
    damage = 0.0_wp
    if (whole > 0.0_wp) damage = lost/whole
  end function point_damage

  !> theta of all slots.
  subroutine reference_dilatation(family, model, u, theta)
    class(family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model     !! parameters of the slots
    real(wp), intent(in) :: u(:, :)           !! (n_slots, dim) displacements [m]
    real(wp), intent(out) :: theta(:)         !! (n_slots) dilatation [-]
    type(bonds_type) :: bonds
    integer :: k

    !$omp parallel default(none) shared(family, model, u, theta) private(bonds, k)
    call allocate_bonds(family, bonds)
    !$omp do schedule(static)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      theta(k) = point_dilatation(model, u, k, bonds)
    end do
    !$omp end parallel
  end subroutine reference_dilatation

  !> Force density of all slots (n_slots, dim) [N/m3].
  subroutine reference_force(family, model, u, force)
    class(family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model  !! parameters of the slots
    real(wp), intent(in) :: u(:, :)       !! (n_slots, dim) displacements [m]
    real(wp), intent(out) :: force(:, :)  !! (n_slots, dim) of the bonds alone, without terms [N/m3]
    type(bonds_type) :: bonds
    real(wp), allocatable :: p(:)
    integer :: k

    allocate (p(family%n_slots), source=0.0_wp)
    if (model%dilatation) then
      call reference_dilatation(family, model, u, p)
      p = p*[(p_of(model, k), k=1, family%n_slots)]
    end if
    !$omp parallel default(none) shared(family, model, u, p, force) private(bonds, k)
    call allocate_bonds(family, bonds)
    !$omp do schedule(static)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      force(k, :) = point_force(model, u, p, k, bonds)
    end do
    !$omp end parallel
  end subroutine reference_force

  !> Strain energy density of all slots [J/m3].
  subroutine reference_energy(family, model, u, energy)
    class(family_type), intent(in) :: family  !! the family
    type(model_type), intent(in) :: model     !! parameters of the slots
    real(wp), intent(in) :: u(:, :)           !! (n_slots, dim) displacements [m]
    real(wp), intent(out) :: energy(:)        !! (n_slots) strain energy density [J/m3]
    type(bonds_type) :: bonds
    integer :: k

    !$omp parallel default(none) shared(family, model, u, energy) private(bonds, k)
    call allocate_bonds(family, bonds)
    !$omp do schedule(static)
    do k = 1, family%n_slots
      call family%bonds_of(k, bonds)
      energy(k) = point_energy(model, u, k, bonds)
    end do
    !$omp end parallel
  end subroutine reference_energy

end module pd_force_reference
