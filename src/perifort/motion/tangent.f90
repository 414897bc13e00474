!> The tangent of the internal forces: how they answer to a small further displacement. The largest
!> frequency (spectrum) and solvers that follow the tangent work on it, without a matrix.
module pd_motion_tangent
  use pd_base_kinds, only: wp, i1
  use pd_base_reduce, only: largest_over, largest_of_ranks, least_over
  use pd_body_body, only: share_halo
  use pd_force_forces, only: dilatation_pass, force_pass
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
  !> `w` [N/m3 for `w` in m]; all three are (n_slots, dim), 0 at dead slots. The dilatation is taken
  !> unprojected: the force is then a gradient, so that the tangent is symmetric in the inner
  !> product weighted with the points' volumes. (For an undeformed body both dilatations have this
  !> tangent.) Broken bonds have no stiffness, and no bond breaks.
  !>
  !> Constrained components are held if they are 0 in `w`; in `kw` they have what they resist.
  !>
  !> An undeformed body without temperature change costs one evaluation of the forces, and the
  !> result is exact but for rounding. Elsewhere two evaluations make a central difference: some ten
  !> digits remain where displacements are as large as the spacing, more where they are smaller.
  subroutine apply_tangent(system, u, w, kw)
    type(system_type), intent(inout) :: system
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(in), contiguous :: w(:, :)
    real(wp), intent(inout), contiguous :: kw(:, :)
    real(wp), allocatable :: moved(:, :), behind(:, :)
    real(wp) :: length, strain, spacing, step
    logical :: projected

    length = largest_over(system%body%order, w)
    if (.not. length > 0.0_wp) then
      kw = 0.0_wp
      return
    end if
    spacing = least_over(system%body%order, system%body%spacing)
    strain = largest_over(system%body%order, u)/spacing
    if (system%model%thermal) strain = strain &
      & + largest_of_ranks(system%body%order, maxval(abs(system%model%expansion)))
    allocate (moved(size(w, 1), size(w, 2)))
    if (.not. strain > 0.0_wp) then
      step = undeformed_step*spacing/length
      call displace(u, step, w, moved)
      call forces_at(system, moved, kw)
      call difference(-1/step, kw)
      return
    end if
    ! rounding (epsilon strain/step) and curvature (step^2) of the same size
    step = min(largest_step, max(least_step, (epsilon(step)*strain)**(1.0_wp/3)))*spacing/length
    allocate (behind(size(w, 1), size(w, 2)))
    projected = system%model%projected
    system%model%projected = .false.
    system%model%for_differences = .true.
    call displace(u, -step, w, moved)
    call forces_at(system, moved, behind)
    call displace(u, step, w, moved)
    call forces_at(system, moved, kw)
    system%model%projected = projected
    system%model%for_differences = .false.
    call difference(-1/(2*step), kw, behind)
  end subroutine apply_tangent

  !> Internal force density at displacements `u`. The marks of strained slots, which bond breaking
  !> looks at, and the dilatation of the system's own state are left alone.
  subroutine forces_at(system, u, force)
    type(system_type), intent(inout) :: system
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), intent(inout), contiguous :: force(:, :)
    real(wp), allocatable :: p(:), shared(:, :)
    integer(i1), allocatable :: strained(:)

    associate (n => system%body%n_slots, model => system%model)
      allocate (p(merge(n, 0, model%dilatation)), source=0.0_wp)
      allocate (strained(merge(n, 0, model%breaking)), source=0_i1)
      force = 0.0_wp  ! the passes leave out slots far from any point
      if (associated(system%body%order%ranks)) then
        allocate (shared, source=u)
        call share_halo(system%body, shared)
        if (model%dilatation) call dilatation_pass(system%family, model, shared, p, strained)
        if (model%dilatation) call share_halo(system%body, p)
        call force_pass(system%family, model, shared, p, force, strained)
        call share_halo(system%body, force)
        return
      end if
      if (model%dilatation) call dilatation_pass(system%family, model, u, p, strained)
      call force_pass(system%family, model, u, p, force, strained)
    end associate
  end subroutine forces_at

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

  !> `values` = `factor` (`values` - `other`).
  subroutine difference(factor, values, other)
    real(wp), intent(in) :: factor
    real(wp), intent(inout), contiguous :: values(:, :)
    real(wp), intent(in), contiguous, optional :: other(:, :)
    integer :: k, c

    do c = 1, size(values, 2)
      !$omp parallel do schedule(static) default(none) shared(factor, values, other, c) private(k)
      do k = 1, size(values, 1)
        if (present(other)) values(k, c) = values(k, c) - other(k, c)
        values(k, c) = factor*values(k, c)
      end do
    end do
  end subroutine difference

end module pd_motion_tangent
