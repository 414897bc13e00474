!> The tangent of the bonds' forces: how they answer to a small further displacement, as differences
!> of these forces, without a matrix.
module pd_force_tangent
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1
  use pd_body_body, only: body_type, start_halo
  use pd_family_family, only: family_type
  use pd_force_forces, only: arriving_force, internal_force, whole
  use pd_force_model, only: force_options_type, model_type
  use pd_force_workspace, only: workspace_type
  implicit none (type, external)
  private
  public :: tangent_type, tangent_product, bond_forces_at
  public :: about_undeformed, one_sided, central

  !> Differences that make a tangent: -F(h w)/h of the undeformed body, which bears no force without
  !> displacement; (F(u) - F(u + h w))/h; (F(u - h w) - F(u + h w))/(2 h).
  integer, parameter :: about_undeformed = 1, one_sided = 2, central = 3

  !> How a product with the tangent is formed.
  type :: tangent_type
    type(force_options_type) :: options  !! of the forces
    integer :: difference = central      !! `about_undeformed`, `one_sided` or `central`
    real(wp) :: step = 1.0_wp            !! the factor h of the direction [-]
    real(wp), allocatable :: forces(:, :)  !! F(u) of `one_sided` differences (n_slots, dim) [N/m3]
    real(wp), allocatable :: moved(:, :)   !! room, made where there is none yet [m]
  end type tangent_type

contains

  !> `kw` = minus the difference of the bonds' force densities in the direction `w`, formed as
  !> `tangent` says: the one product with their stiffness.
  subroutine tangent_product(body, family, model, workspace, tangent, u, w, kw)
    type(body_type), intent(in) :: body               !! arranged in the slots of the family
    class(family_type), intent(in) :: family          !! broken bonds have no stiffness
    type(model_type), intent(in) :: model             !! parameters of the slots
    type(workspace_type), intent(inout) :: workspace  !! of this family and model
    type(tangent_type), intent(inout) :: tangent
      !! kind of the difference, its step and what the forces take in; its room changes
    real(wp), intent(in), contiguous :: u(:, :)       !! where; 0 if `about_undeformed` [m]
    real(wp), intent(in), contiguous :: w(:, :)       !! direction (n_slots, dim) [m]
    real(wp), intent(inout), contiguous :: kw(:, :)   !! product (n_slots, dim), set [N/m3]
    real(wp), allocatable :: behind(:, :)

    select case (tangent%difference)
    case (about_undeformed)
      if (abs(tangent%step - 1) > 0.0_wp) then
        call put_forces_at(tangent%step, kw)
      else
        call bond_forces_at(body, family, model, workspace, tangent%options, w, kw)
      end if
      call multiply(-1/tangent%step, kw)
    case (one_sided)
      if (.not. allocated(tangent%forces)) &
        & call internal_fault('a one-sided difference without its side')
      call put_forces_at(tangent%step, kw)
      call one_sided_difference(1/tangent%step, tangent%forces, kw)
    case (central)
      allocate (behind(size(w, 1), size(w, 2)))
      call put_forces_at(-tangent%step, behind)
      call put_forces_at(tangent%step, kw)
      call central_difference(-1/(2*tangent%step), behind, kw)
    case default
      call internal_fault('a tangent by an unknown difference')
    end select

  contains

    !> Force density at `u` + `step` `w`.
    subroutine put_forces_at(step, force)
      real(wp), intent(in) :: step
      real(wp), intent(inout), contiguous :: force(:, :)

      if (.not. allocated(tangent%moved)) allocate (tangent%moved(size(w, 1), size(w, 2)))
      call displace(u, step, w, tangent%moved)
      call bond_forces_at(body, family, model, workspace, tangent%options, tangent%moved, force)
    end subroutine put_forces_at
  end subroutine tangent_product

  !> The bonds' force density at any displacements. Marks and dilatation of the body's own state,
  !> which bond breaking looks at, are left alone.
  subroutine bond_forces_at(body, family, model, workspace, options, u, force)
    type(body_type), intent(in) :: body               !! arranged in the slots of the family
    class(family_type), intent(in) :: family          !! the bonds of each point
    type(model_type), intent(in) :: model             !! parameters of the slots
    type(workspace_type), intent(inout) :: workspace  !! of this family and model
    type(force_options_type), intent(in) :: options   !! what the forces take in
    real(wp), intent(in), contiguous :: u(:, :)
      !! displacements (n_slots, dim) of this process' own points [m]
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) set for all slots [N/m3]
    real(wp), allocatable :: shared(:, :), p(:)
    integer(i1), allocatable :: strained(:)

    allocate (p(merge(body%n_slots, 0, options%dilatation)), source=0.0_wp)
    allocate (strained(merge(body%n_slots, 0, model%breaking)), source=0_i1)
    force = 0.0_wp  ! the passes leave out slots far from any point
    if (associated(body%order%ranks)) then
      shared = u
      call start_halo(body, shared)
      call arriving_force(body, family, model, options, workspace, shared, p, force, strained, &
        & whole, of_copies=.true.)
    else
      call internal_force(body, family, model, options, workspace, u, p, force, strained)
    end if
  end subroutine bond_forces_at

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

end module pd_force_tangent
