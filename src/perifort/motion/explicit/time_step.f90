!> The stable time step (7.25 in the form of doc/theory.md, 6).
module pd_motion_explicit_time_step
  use pd_base_kinds, only: wp
  use pd_base_error, only: internal_fault
  use pd_base_numbers, only: pi
  use pd_base_reduce, only: largest_of_ranks
  use pd_body_body, only: body_type, owned, share_halo
  use pd_family_family, only: family_type, bonds_type, allocate_bonds
  use pd_family_surface, only: bond_factor
  use pd_family_lattice, only: lattice_family_type
  use pd_force_bound, only: lattice_bound, lattice_printed_bound
  use pd_force_generic_pass, only: generic_bound
  use pd_force_model, only: bond_factors_of, model_type, q_of, t_of
  use pd_force_workspace, only: workspace_type
  implicit none (type, external)
  private
  public :: stiffness_bound, stable_step, printed_step, printed_stiffness, book_step, &
    & chapter_stiffness, integrator_limit, damped_step, evaluations
  public :: constant_stiffness, horizon_volume

contains

  !> M_k [N/m4] of every slot, 0 for points without bonds:
  !> sum_j [ (q_k+q_j) Gb + (m_k I_k + m_j I_j) Gd ] vc V_j/|xi|, m = 2 max(a,0) (d delta)^2,
  !> I_k = sum_l Gd vc V_l/|xi|. The step sqrt(2 rho/M) and the relaxation's mass come from it.
  subroutine stiffness_bound(body, family, model, workspace, bound)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole; broken bonds count as if they were intact
    type(model_type), intent(in) :: model     !! with surface factors, if there are any
    type(workspace_type), intent(in) :: workspace  !! of this family and model
    real(wp), intent(inout), contiguous :: bound(:)  !! (n_slots) M_k [N/m4]
    type(bonds_type) :: bonds
    real(wp), allocatable :: inverse(:)
    real(wp) :: n(body%dim)
    integer :: k, i, j

    if (model%generic) then
      call generic_bound(family, model, workspace%generic, bound)
      return
    end if
    select type (family)
    type is (lattice_family_type)
      ! the weights hold all that is needed, unless they are not made yet
      if (allocated(workspace%lattice%table)) then
        call lattice_bound(body, family, model, workspace%lattice, bound)
        return
      end if
    class default  ! below, bond by bond, which suits any family
      continue
    end select
    allocate (inverse(body%n_slots), source=0.0_wp)
    if (model%dilatation) then
      !$omp parallel default(none) shared(body, family, model, inverse) private(bonds, n, k, i, j)
      call allocate_bonds(family, bonds)
      !$omp do schedule(dynamic, 256)
      do k = 1, body%n_slots
        if (body%point(k) == 0) cycle
        call family%bonds_of(k, bonds)
        do i = 1, bonds%n
          j = bonds%j(i)
          n = bonds%xi(i, :)/bonds%length(i)
          if (model%consistent) then
            inverse(k) = inverse(k) + bond_size(model, k, i, .true.)*law_factor(model, k, j, &
              & bonds%length(i), .true.)*bonds%weight(i)/bonds%length(i)
          else if (model%weighted) then
            inverse(k) = inverse(k) + surface_factor(model, model%D, n, k, j) &
              & *law_factor(model, k, j, bonds%length(i), .true.)*bonds%weight(i)/bonds%length(i)
          else
            inverse(k) = inverse(k) + surface_factor(model, model%D, n, k, j)*bonds%weight(i) &
              & /bonds%length(i)
          end if
        end do
        associate (m => model%materials(model%material(k)))
          inverse(k) = inverse(k)*2*max(m%a, 0.0_wp)*t_of(model, k)**2
        end associate
      end do
      !$omp end parallel
      call share_halo(body, inverse)
    end if
    !$omp parallel default(none) shared(body, family, model, bound, inverse) &
    !$omp private(bonds, n, k, i, j)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      bound(k) = 0.0_wp
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      do i = 1, bonds%n
        j = bonds%j(i)
        n = bonds%xi(i, :)/bonds%length(i)
        if (model%consistent) then
          bound(k) = bound(k) + ((q_of(model, k) + q_of(model, j))*bond_size(model, k, i, .false.) &
            & *law_factor(model, k, j, bonds%length(i), .false.) &
            & + (inverse(k) + inverse(j))*bond_size(model, k, i, .true.) &
            & *law_factor(model, k, j, bonds%length(i), .true.)) &
            & *bonds%weight(i)/bonds%length(i)
          cycle
        end if
        if (.not. model%weighted) then
          bound(k) = bound(k) + ((model%materials(model%material(k))%q &
            & + model%materials(model%material(j))%q)*surface_factor(model, model%S, n, k, j) &
            & + (inverse(k) + inverse(j))*surface_factor(model, model%D, n, k, j)) &
            & *bonds%weight(i)/bonds%length(i)
          cycle
        end if
        bound(k) = bound(k) + ((q_of(model, k) + q_of(model, j)) &
          & *surface_factor(model, model%S, n, k, j) &
          & *law_factor(model, k, j, bonds%length(i), .false.) &
          & + (inverse(k) + inverse(j))*surface_factor(model, model%D, n, k, j) &
          & *law_factor(model, k, j, bonds%length(i), .true.))*bonds%weight(i)/bonds%length(i)
      end do
    end do
    !$omp end parallel
  end subroutine stiffness_bound

  !> The size of Gd or Gb of the bond k-j along the unit vector n.
  pure real(wp) function surface_factor(model, g, n, k, j)
    type(model_type), intent(in) :: model
    real(wp), allocatable, intent(in) :: g(:, :)
    real(wp), intent(in) :: n(:)
    integer, intent(in) :: k, j
    surface_factor = 1.0_wp
    if (model%surface) surface_factor = abs(bond_factor(n, g(k, :), g(j, :), model%axes))
  end function surface_factor

  !> The size of the consistent weight of the `i`-th bond of slot `k`.
  pure real(wp) function bond_size(model, k, i, of_dilatation) result(weight)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, i
    logical, intent(in) :: of_dilatation

    associate (place => model%weights%before(k) + i)
      weight = abs(merge(model%weights%Gd(place), model%weights%Gb(place), of_dilatation))
    end associate
  end function bond_size

  !> The size of a law's factor of a bond: that of the dilatation or of the stretch.
  pure real(wp) function law_factor(model, k, j, length, of_dilatation) result(factor)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k, j
    real(wp), intent(in) :: length
    logical, intent(in) :: of_dilatation
    real(wp) :: gb, gd

    factor = 1.0_wp
    if (.not. model%weighted) return
    call bond_factors_of(model, k, j, length, gb, gd)
    factor = abs(merge(gd, gb, of_dilatation))
  end function law_factor

  !> 7.25: the smallest sqrt(2 rho_k/M_k) [s].
  real(wp) function stable_step(body, model, bound) result(step)
    type(body_type), intent(in) :: body    !! arranged in slots
    type(model_type), intent(in) :: model  !! densities of the slots
    real(wp), intent(in) :: bound(:)       !! (n_slots) M_k; slots with 0 do not count [N/m4]
    integer :: k

    step = huge(step)
    do k = 1, body%n_slots
      ! copies of other ranks' points do not have all their bonds
      if (bound(k) > 0.0_wp .and. owned(body, k)) &
        & step = min(step, sqrt(2*model%materials(model%material(k))%density/bound(k)))
    end do
    step = -largest_of_ranks(body%order, -step)
  end function stable_step

  !> 7.25 as printed: without surface factors, and with the plain sign of a. Negative sums have no
  !> step: 0 is returned. Shown beside the step that is used, for the chapter's laws alone.
  subroutine printed_step(body, family, model, step)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole; broken bonds count as if they were intact
    type(model_type), intent(in) :: model     !! materials of the slots
    real(wp), intent(out) :: step             !! 0 if some sum is negative [s]
    real(wp), allocatable :: printed(:)
    real(wp) :: squared
    integer :: k

    allocate (printed(body%n_slots), source=0.0_wp)
    call printed_stiffness(body, family, model, printed)
    squared = huge(squared)
    do k = 1, body%n_slots
      if (.not. owned(body, k)) cycle
      ! a sum that is exactly 0 has no bonds
      if (printed(k) < 0.0_wp) squared = 0.0_wp
      if (printed(k) > 0.0_wp) &
        & squared = min(squared, 2*model%materials(model%material(k))%density/printed(k))
    end do
    step = sqrt(-largest_of_ranks(body%order, -squared))
  end subroutine printed_step

  !> The sum of 7.25 as printed for every slot [N/m4], 0 without bonds: no surface factors, a with
  !> its sign. Its inner sum has the plain volumes in the book, and is all but the same with v_c.
  subroutine printed_stiffness(body, family, model, printed)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole; broken bonds count as if they were intact
    type(model_type), intent(in) :: model     !! materials of the slots
    real(wp), intent(inout), contiguous :: printed(:)  !! (n_slots) set for all slots [N/m4]

    select type (family)
    type is (lattice_family_type)
      call lattice_printed_bound(family, model, printed)
    class default  ! bond by bond, which suits any family
      call printed_bound(body, family, model, printed)
    end select
  end subroutine printed_stiffness

  !> `printed_stiffness`, bond by bond.
  subroutine printed_bound(body, family, model, printed)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(model_type), intent(in) :: model
    real(wp), intent(out) :: printed(:)
    type(bonds_type) :: bonds
    real(wp), allocatable :: inverse(:)
    integer :: k, i

    allocate (inverse(body%n_slots), source=0.0_wp)
    !$omp parallel default(none) shared(body, family, model, inverse, printed) private(bonds, k, i)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      inverse(k) = sum(bonds%weight(:bonds%n)/bonds%length(:bonds%n))
    end do
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      printed(k) = 0.0_wp
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      associate (m => model%materials(model%material(k)))
        do i = 1, bonds%n
          printed(k) = printed(k) + (2*m%a*m%t**2*(inverse(k) + inverse(bonds%j(i))) + 2*m%q) &
            & *bonds%weight(i)/bonds%length(i)
        end do
      end associate
    end do
    !$omp end parallel
  end subroutine printed_bound

  !> Volume of the horizon [m3]: 4/3 pi delta^3, pi delta^2 h, 2 delta A.
  pure real(wp) function horizon_volume(dim, delta, depth) result(volume)
    integer, intent(in) :: dim     !! number of dimensions
    real(wp), intent(in) :: delta  !! horizon [m]
    real(wp), intent(in) :: depth
      !! thickness in 2D [m], cross section in 1D [m2], without meaning in 3D
    select case (dim)
    case (3); volume = 4*pi*delta**3/3
    case (2); volume = pi*delta**2*depth
    case default; volume = 2*delta*depth
    end select
  end function horizon_volume

  !> The book's own estimate of the step, sqrt(2 rho dx/(V_h c)) [s], least over the materials.
  pure real(wp) function book_step(model, dim, delta, depth, spacing) result(step)
    type(model_type), intent(in) :: model  !! its materials
    integer, intent(in) :: dim             !! number of dimensions
    real(wp), intent(in) :: delta          !! horizon [m]
    real(wp), intent(in) :: depth
      !! thickness in 2D [m], cross section in 1D [m2], without meaning in 3D
    real(wp), intent(in) :: spacing        !! smallest spacing [m]
    step = minval(sqrt(2*model%materials%density*spacing &
      & /(horizon_volume(dim, delta, depth)*2*model%materials%q)))
  end function book_step

  !> The sum 7.32 for each component, each term times vc V_j [N/m4].
  subroutine chapter_stiffness(body, family, model, stiffness)
    type(body_type), intent(in) :: body       !! arranged in the slots of the family
    class(family_type), intent(in) :: family  !! whole; broken bonds count as if they were intact
    type(model_type), intent(in) :: model     !! materials of the slots; no surface factors come in
    real(wp), intent(out) :: stiffness(:, :)  !! (n_slots, dim) 0 for dead slots [N/m4]
    type(bonds_type) :: bonds
    real(wp) :: term, delta
    integer :: k, i, c, j

    delta = family%rule%delta
    !$omp parallel default(none) shared(body, family, model, stiffness, delta) &
    !$omp private(bonds, k, i, c, j, term)
    call allocate_bonds(family, bonds)
    !$omp do schedule(dynamic, 256)
    do k = 1, body%n_slots
      stiffness(k, :) = 0.0_wp
      if (body%point(k) == 0) cycle
      call family%bonds_of(k, bonds)
      associate (m => model%materials(model%material(k)))
        do i = 1, bonds%n
          j = bonds%j(i)
          term = 4*delta/bonds%length(i)*(0.5_wp*max(m%a, 0.0_wp)*m%d**2*delta/bonds%length(i) &
            & *(body%volume(k)*bonds%weight(i)/body%volume(j) + bonds%weight(i)) &
            & + m%b)*bonds%weight(i)
          do c = 1, body%dim
            stiffness(k, c) = stiffness(k, c) + abs(bonds%xi(i, c))/bonds%length(i)*term
          end do
        end do
      end associate
    end do
    !$omp end parallel
  end subroutine chapter_stiffness

  !> V_h c/spacing of every slot, the book's own estimate of the stiffness [N/m4].
  pure subroutine constant_stiffness(body, model, delta, depth, stiffness)
    type(body_type), intent(in) :: body    !! arranged in slots
    type(model_type), intent(in) :: model  !! materials of the slots
    real(wp), intent(in) :: delta          !! horizon [m]
    real(wp), intent(in) :: depth
      !! thickness in 2D [m], cross section in 1D [m2], without meaning in 3D
    real(wp), intent(out) :: stiffness(:)  !! (n_slots) 0 for dead slots [N/m4]
    integer :: k

    do k = 1, body%n_slots
      stiffness(k) = 0.0_wp
      if (body%point(k) == 0) cycle
      stiffness(k) = horizon_volume(body%dim, delta, depth)*2*model%materials(model%material(k))%q &
        & /body%spacing(k)
    end do
  end subroutine constant_stiffness

  !> Largest stable omega dt of an integrator on the undamped oscillator.
  pure real(wp) function integrator_limit(integrator) result(limit)
    character(*), intent(in) :: integrator  !! value of `integrator` in &time
    select case (integrator)
    case ('adams_bashforth'); limit = 0.72_wp
    case ('adams_moulton'); limit = 1.29_wp
    case ('runge_kutta'); limit = 2.83_wp
    case ('forward_backward', 'velocity_verlet'); limit = 2.0_wp
    case default
      call internal_fault('unknown integrator')
    end select
  end function integrator_limit

  !> The stable step where something is slowed down as well: `step` is that without damping [s], and
  !> `rate` the largest ratio of damping to density [1/s]. With forces from the velocities of half a
  !> step before, 7.8 and 7.9 are stable while (step omega/2)^2 + step rate/2 <= 1; the others are
  !> so while step omega and step rate lie in an ellipse about their limits on both axes, of which
  !> this takes the chord.
  pure real(wp) function damped_step(step, rate, integrator) result(damped)
    real(wp), intent(in) :: step            !! stable step without damping [s]
    real(wp), intent(in) :: rate            !! largest ratio of damping to density [1/s]
    character(*), intent(in) :: integrator  !! value of `integrator` in &time
    real(wp) :: half

    select case (integrator)
    case ('forward_backward', 'velocity_verlet')
      half = rate*step/4
      damped = step/(half + sqrt(half**2 + 1))
    case ('adams_bashforth')
      damped = step/(1 + step*rate/(6.0_wp/11))
    case ('adams_moulton')
      damped = step/(1 + step*rate/2)
    case ('runge_kutta')
      damped = step/(1 + step*rate/2.78_wp)
    case default
      call internal_fault('unknown integrator')
    end select
  end function damped_step

  !> Force evaluations of one step of an integrator.
  pure integer function evaluations(integrator)
    character(*), intent(in) :: integrator  !! value of `integrator` in &time
    select case (integrator)
    case ('runge_kutta'); evaluations = 4
    case ('adams_moulton'); evaluations = 2
    case ('forward_backward', 'velocity_verlet', 'adams_bashforth'); evaluations = 1
    case default
      call internal_fault('unknown integrator')
    end select
  end function evaluations

end module pd_motion_explicit_time_step
