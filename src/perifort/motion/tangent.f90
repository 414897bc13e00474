!> The tangent of the internal forces: how they answer to a small further displacement. The largest
!> frequency (spectrum) and the solvers of static equilibrium work on it, without a matrix.
module pd_motion_tangent
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1
  use pd_base_reduce, only: largest_over, largest_of_ranks, least_over
  use pd_body_body, only: share_halo
  use pd_force_forces, only: internal_force
  use pd_force_model, only: force_options_type, model_type, options_of
  use pd_force_workspace, only: workspace_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: apply_tangent, tangent_type, tangent_product, forces_at
  public :: about_undeformed, one_sided, central

  !> Differences that make a tangent: -F(h w)/h of the undeformed body, which bears no force without
  !> displacement; (F(u) - F(u + h w))/h; (F(u - h w) - F(u + h w))/(2 h).
  integer, parameter :: about_undeformed = 1, one_sided = 2, central = 3

  !> How a product with the tangent is formed.
  type :: tangent_type
    type(force_options_type) :: options  !! of the forces
    integer :: difference = central      !! `about_undeformed`, `one_sided` or `central`
    real(wp) :: step = 1.0_wp            !! the factor h of the direction [-]
  end type tangent_type

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
    real(wp), allocatable :: moved(:, :)
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
    call tangent_product(system, tangent, u, w, kw, moved, model=model, workspace=workspace)
  end subroutine apply_tangent

  !> `kw` = minus the difference of the internal force densities in the direction `w`, formed as
  !> `tangent` says: the one product with a stiffness.
  subroutine tangent_product(system, tangent, u, w, kw, moved, forces, model, workspace)
    type(system_type), intent(inout) :: system
      !! its state stays as it is; its workspace changes
    type(tangent_type), intent(in) :: tangent
      !! kind of the difference, its step and what the forces take in
    real(wp), intent(in), contiguous :: u(:, :)          !! where; 0 if `about_undeformed` [m]
    real(wp), intent(in), contiguous :: w(:, :)          !! direction (n_slots, dim) [m]
    real(wp), intent(inout), contiguous :: kw(:, :)      !! product (n_slots, dim) [N/m3]
    real(wp), allocatable, intent(inout) :: moved(:, :)  !! room, made where there is none yet
    real(wp), intent(in), contiguous, optional :: forces(:, :)  !! those at `u`, for `one_sided`
                                                                !! differences [N/m3]
    type(model_type), intent(in), optional :: model      !! the system's by default
    type(workspace_type), intent(inout), optional :: workspace  !! of `model`, given with it
    real(wp), allocatable :: behind(:, :)

    associate (step => tangent%step, options => tangent%options)
      select case (tangent%difference)
      case (about_undeformed)
        if (abs(step - 1) > 0.0_wp) then
          call make_room()
          call displace(u, step, w, moved)
          call forces_at(system, moved, kw, options, model, workspace)
        else
          call forces_at(system, w, kw, options, model, workspace)
        end if
        call multiply(-1/step, kw)
      case (one_sided)
        if (.not. present(forces)) call internal_fault('a one-sided difference without its side')
        call make_room()
        call displace(u, step, w, moved)
        call forces_at(system, moved, kw, options, model, workspace)
        call one_sided_difference(1/step, forces, kw)
      case (central)
        allocate (behind(size(w, 1), size(w, 2)))
        call make_room()
        call displace(u, -step, w, moved)
        call forces_at(system, moved, behind, options, model, workspace)
        call displace(u, step, w, moved)
        call forces_at(system, moved, kw, options, model, workspace)
        call central_difference(-1/(2*step), behind, kw)
      case default
        call internal_fault('a tangent by an unknown difference')
      end select
    end associate

  contains

    subroutine make_room()
      if (.not. allocated(moved)) allocate (moved(size(w, 1), size(w, 2)))
    end subroutine make_room
  end subroutine tangent_product

  !> Internal force density at displacements `u`. The marks of strained slots, which bond breaking
  !> looks at, and the dilatation of the system's own state are left alone.
  subroutine forces_at(system, u, force, options, model, workspace)
    type(system_type), intent(inout) :: system
      !! its state stays as it is; its workspace changes
    real(wp), intent(in), contiguous :: u(:, :)                !! (n_slots, dim) displacements [m]
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) set for all slots, terms not included [N/m3]
    type(force_options_type), intent(in), optional :: options  !! the model's own by default
    type(model_type), intent(in), optional :: model            !! the system's by default
    type(workspace_type), intent(inout), optional :: workspace !! of `model`, given with it
    real(wp), allocatable :: shared(:, :)

    if (associated(system%body%order%ranks)) then
      shared = u
      call share_halo(system%body, shared)
      call own_forces_at(system, shared, force, options, model, workspace)
    else
      call own_forces_at(system, u, force, options, model, workspace)
    end if
  end subroutine forces_at

  !> The same where displacements of points that other processes own are known.
  subroutine own_forces_at(system, u, force, options, model, workspace)
    type(system_type), intent(inout) :: system
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: force(:, :)
    type(force_options_type), intent(in), optional :: options
    type(model_type), intent(in), optional :: model
    type(workspace_type), intent(inout), optional :: workspace
    type(force_options_type) :: taken
    real(wp), allocatable :: p(:)
    integer(i1), allocatable :: strained(:)

    taken = options_of(system%model)
    if (present(options)) taken = options
    associate (n => system%body%n_slots)
      allocate (p(merge(n, 0, taken%dilatation)), source=0.0_wp)
      allocate (strained(merge(n, 0, system%model%breaking)), source=0_i1)
    end associate
    force = 0.0_wp  ! the passes leave out slots far from any point
    if (present(model)) then
      if (.not. present(workspace)) call internal_fault('another model without its workspace')
      call internal_force(system%body, system%family, model, taken, workspace, u, p, force, &
        & strained)
    else
      call internal_force(system%body, system%family, system%model, taken, system%workspace, u, &
        & p, force, strained)
    end if
  end subroutine own_forces_at

  !> `moved` = `u` + `step` `w`.
  subroutine displace(u, step, w, moved)
    real(wp), intent(in), contiguous :: u(:, :), w(:, :)
    real(wp), intent(in) :: step
    real(wp), intent(inout), contiguous :: moved(:, :)
    integer :: k, c

    do c = 1, size(u, 2)
      !$omp parallel do simd schedule(static) default(none) shared(u, step, w, moved, c) private(k)
      do k = 1, size(u, 1)
        moved(k, c) = u(k, c) + step*w(k, c)
      end do
    end do
  end subroutine displace

  !> `values` = `factor` `values`.
  subroutine multiply(factor, values)
    real(wp), intent(in) :: factor
    real(wp), intent(inout), contiguous :: values(:, :)
    integer :: k, c

    do c = 1, size(values, 2)
      !$omp parallel do simd schedule(static) default(none) shared(factor, values, c) private(k)
      do k = 1, size(values, 1)
        values(k, c) = factor*values(k, c)
      end do
    end do
  end subroutine multiply

  !> `ahead` = `factor` (`ahead` - `behind`).
  subroutine central_difference(factor, behind, ahead)
    real(wp), intent(in) :: factor
    real(wp), intent(in), contiguous :: behind(:, :)
    real(wp), intent(inout), contiguous :: ahead(:, :)
    integer :: k, c

    do c = 1, size(ahead, 2)
      !$omp parallel do simd schedule(static) default(none) shared(factor, behind, ahead, c) &
      !$omp private(k)
      do k = 1, size(ahead, 1)
        ahead(k, c) = factor*(ahead(k, c) - behind(k, c))
      end do
    end do
  end subroutine central_difference

  !> `ahead` = `factor` (`here` - `ahead`).
  subroutine one_sided_difference(factor, here, ahead)
    real(wp), intent(in) :: factor
    real(wp), intent(in), contiguous :: here(:, :)
    real(wp), intent(inout), contiguous :: ahead(:, :)
    integer :: k, c

    do c = 1, size(ahead, 2)
      !$omp parallel do simd schedule(static) default(none) shared(factor, here, ahead, c) &
      !$omp private(k)
      do k = 1, size(ahead, 1)
        ahead(k, c) = factor*(here(k, c) - ahead(k, c))
      end do
    end do
  end subroutine one_sided_difference

end module pd_motion_tangent
