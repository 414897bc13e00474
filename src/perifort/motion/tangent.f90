!> The tangent of the bonds' forces of a system, with the difference that suits its displacements.
!> The largest frequency (spectrum) and the set-up of static equilibrium work on it, without a
!> matrix.
module pd_motion_tangent
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: largest_over, largest_of_ranks, least_over
  use pd_force_model, only: force_options_type, model_type, options_of
  use pd_force_tangent, only: about_undeformed, bond_forces_at, central, tangent_product, &
    & tangent_type
  use pd_force_workspace, only: workspace_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: apply_tangent, forces_at

  !> Displacement over the spacing at which an undeformed body is probed. The loops form stretches
  !> from displacements alone, so that they are as accurate here as anywhere, and what is not linear
  !> lies below the last digit.
  real(wp), parameter :: undeformed_step = 1.0e-20_wp
  !> Bounds of the step of central differences about a deformed state, over the spacing.
  real(wp), parameter :: least_step = 1.0e-9_wp, largest_step = 1.0e-4_wp

contains

  !> `kw` = minus the derivative of the internal force density at displacements `u` in the direction
  !> `w` [N/m3 for `w` in m]; all three are (n_slots, dim), 0 at dead slots. The dilatation of a
  !> deformed body is taken unprojected: the force is then a gradient, so that the tangent is
  !> symmetric in the inner product weighted with the points' volumes. (For an undeformed body both
  !> dilatations have this tangent.) Broken bonds have no stiffness, and no bond breaks.
  !>
  !> Constrained components are held if they are 0 in `w`; in `kw` they have what they resist.
  !>
  !> An undeformed body without temperature change costs one evaluation of the forces, and the
  !> result is exact but for rounding. Elsewhere two evaluations make a central difference: some ten
  !> digits remain where displacements are as large as the spacing, more where they are smaller.
  subroutine apply_tangent(system, u, w, kw, options, model, workspace)
    type(system_type), intent(inout) :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(in), contiguous :: u(:, :)                !! (n_slots, dim) displacements [m]
    real(wp), intent(in), contiguous :: w(:, :)  !! (n_slots, dim) direction, of any length [m]
    real(wp), intent(inout), contiguous :: kw(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    type(force_options_type), intent(in), optional :: options  !! of the forces; the model's own by
                                                               !! default
    type(model_type), intent(in), optional :: model            !! the system's by default
    type(workspace_type), intent(inout), optional :: workspace !! of `model`, given with it
    type(tangent_type) :: tangent
    real(wp) :: length, strain, spacing

    length = largest_over(system%body%order, w)
    if (.not. length > 0.0_wp) then
      kw = 0.0_wp
      return
    end if
    tangent%options = options_of(system%model)
    if (present(options)) tangent%options = options
    spacing = least_over(system%body%order, system%body%spacing)
    strain = largest_over(system%body%order, u)/spacing
    if (tangent%options%thermal) strain = strain &
      & + largest_of_ranks(system%body%order, maxval(abs(system%model%expansion)))
    if (.not. strain > 0.0_wp) then
      tangent%difference = about_undeformed
      tangent%step = undeformed_step*spacing/length
    else
      ! rounding (epsilon strain/step) and curvature (step^2) of the same size
      tangent%difference = central
      tangent%step = min(largest_step, max(least_step, (epsilon(strain)*strain)**(1.0_wp/3))) &
        & *spacing/length
      tangent%options%projected = .false.
      tangent%options%double = .true.
    end if
    if (present(model)) then
      if (.not. present(workspace)) call internal_fault('another model without its workspace')
      call tangent_product(system%body, system%family, model, workspace, tangent, u, w, kw)
    else
      call tangent_product(system%body, system%family, system%model, system%workspace, tangent, u, &
        & w, kw)
    end if
  end subroutine apply_tangent

  !> The bonds' force density at displacements `u`, as the system's model has it.
  subroutine forces_at(system, u, force, options)
    type(system_type), intent(inout) :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(in), contiguous :: u(:, :)         !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    type(force_options_type), intent(in), optional :: options  !! the model's own by default
    type(force_options_type) :: taken

    taken = options_of(system%model)
    if (present(options)) taken = options
    call bond_forces_at(system%body, system%family, system%model, system%workspace, taken, u, force)
  end subroutine forces_at

end module pd_motion_tangent
