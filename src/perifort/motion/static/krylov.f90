!> The loops over the arrays of a conjugate gradient solve: what is left of the force, the
!> direction, and what the stiffness makes of it (doc/theory.md, 7). Everything is per volume, and
!> inner products are weighted with the points' volumes, in which the stiffness is symmetric.
module pd_motion_static_krylov
  use pd_base_kinds, only: wp, i1
  use pd_base_order, only: block_points, put_block, take_block
  use pd_base_reduce, only: add_block, add_point, inner, largest_of_ranks, largest_over, &
    & new_running, new_sums, running_type, total_of, total_of_running, summed_type => sums_type
  use pd_body_body, only: owned, share_halo
  use pd_force_model, only: force_options_type, options_of
  use pd_force_tangent, only: about_undeformed, one_sided
  use pd_force_term, only: term_view_type
  use pd_motion_coarse, only: add_slow, coarse_type, restrict_to, solve_for
  use pd_motion_loads, only: other_terms
  use pd_motion_newton, only: krylov_type, ritz_type, sums_type
  use pd_motion_pins, only: has_pins
  use pd_motion_static_coarsen, only: make_coarse
  use pd_motion_static_pins, only: add_drive, aim_pins, drive_pins, frame_pins, go_pins
  use pd_motion_system, only: add_loads, ask_bonds, system_type, view_of
  use pd_motion_tangent, only: forces_at
  implicit none (type, external)
  private
  public :: make_room, make_coarse_part, linearise, take_residual, first_direction
  public :: next_direction, take_direction, apply_stiffness, go_along, volume_inner
  public :: smallest_curvature, note_length

  !> Directions are kept this small over the horizon: there the forces are linear to the last digit,
  !> so that one evaluation at a direction itself is the product with the undeformed stiffness.
  real(wp), parameter :: direction_size = 1.0e-14_wp, largest_size = 1.0e-10_wp
  !> Step of the differences that make the tangent of a deformed body, over the horizon.
  real(wp), parameter :: difference_size = 1.0e-8_wp
  !> Curvature over that of the preconditioner, below which a direction meets no stiffness at all.
  real(wp), parameter :: smallest_curvature = 1.0e-14_wp

contains

  !> Room for a system's solves, where there is none yet; `mass` (n_slots, dim) is the
  !> preconditioner [N/m4].
  subroutine make_room(system, mass, krylov)
    type(system_type), intent(in) :: system  !! whose constrained components are held
    real(wp), intent(in) :: mass(:, :)       !! (n_slots, dim) [N/m4]
    type(krylov_type), intent(inout) :: krylov
      !! gets room, and the inverse of `mass`, 0 where held and where other ranks own the point
    integer :: k

    if (.not. allocated(krylov%residual)) allocate (krylov%residual, krylov%direction, &
      & krylov%origin, source=0.0_wp*mass)
    allocate (krylov%product, krylov%inverse, source=0.0_wp*mass)
    where (mass > 0.0_wp .and. system%held == 0_i1) krylov%inverse = 1/mass
    ! directions are made where points are owned; copies get them when the forces need them
    do k = 1, size(krylov%inverse, 1)
      if (.not. owned(system%body, k)) krylov%inverse(k, :) = 0.0_wp
    end do
    if (.not. allocated(krylov%of_pins)) allocate (krylov%of_pins(6, &
      & merge(size(system%motions), 0, has_pins(system))), source=0.0_wp)
    if (size(krylov%of_pins) == 0) return
    krylov%mass = mass
    call frame_pins(system, mass, krylov%origin, krylov%frames)
  end subroutine make_room

  !> Give the preconditioner a part for slowly varying displacements where the body is large enough.
  subroutine make_coarse_part(system, krylov)
    type(system_type), intent(inout) :: system  !! whose memory keeps it
    type(krylov_type), intent(inout) :: krylov  !! gets room for its unknowns
    type(coarse_type), allocatable :: coarse

    call move_alloc(system%memory%coarse, coarse)
    if (.not. allocated(coarse)) allocate (coarse)
    call make_coarse(system, coarse)
    if (coarse%n > 0) allocate (krylov%on_slow(coarse%n), krylov%slow(coarse%n), source=0.0_wp)
    call move_alloc(coarse, system%memory%coarse)
  end subroutine make_coarse_part

  !> How the slowly varying displacements answer to the residual; `rho` gets what they add.
  subroutine aim_slow(system, krylov, rho)
    type(system_type), intent(in) :: system
    type(krylov_type), intent(inout) :: krylov
    real(wp), intent(inout) :: rho
    real(wp), allocatable :: field(:, :)

    if (.not. allocated(krylov%slow)) return
    if (size(krylov%of_pins) > 0) then
      field = krylov%residual
      call add_drive(system, krylov%frames, krylov%origin, krylov%of_pins, 1.0_wp, field, &
        & krylov%mass)
      call restrict_to(system%memory%coarse, system%body%volume, field, krylov%on_slow)
    else
      call restrict_to(system%memory%coarse, system%body%volume, krylov%residual, krylov%on_slow)
    end if
    call solve_for(system%memory%coarse, krylov%on_slow, krylov%slow)
    rho = rho + dot_product(krylov%on_slow, krylov%slow)
  end subroutine aim_slow

  !> Add that answer to the direction, times `factor`. The points of a pin move as its free motions
  !> can follow. `largest` is the largest component of the direction then.
  subroutine add_slow_answer(system, factor, krylov, largest)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: factor
    type(krylov_type), intent(inout) :: krylov
    real(wp), intent(inout) :: largest
    real(wp), allocatable :: field(:, :)
    real(wp) :: of_field
    integer :: m

    if (.not. allocated(krylov%slow)) return
    call add_slow(system%memory%coarse, krylov%slow, factor, krylov%inverse, krylov%direction, &
      & largest)
    if (size(krylov%of_pins) == 0) return
    allocate (field(size(krylov%mass, 1), size(krylov%mass, 2)), source=0.0_wp)
    call add_slow(system%memory%coarse, krylov%slow, 1.0_wp, krylov%mass, field, of_field)
    call add_drive(system, krylov%frames, krylov%origin, drive_pins(system, krylov%frames, &
      & krylov%origin, field*krylov%mass), factor, krylov%direction)
    do m = 1, size(krylov%frames)
      if (krylov%frames(m)%number > 0) largest = max(largest, &
        & maxval(abs(krylov%direction(system%motions(m)%slots, :))))
    end do
  end subroutine add_slow_answer

  !> The residual from the system's forces and the loads at `t`, and its sums.
  subroutine take_residual(system, t, krylov, sums)
    type(system_type), intent(inout) :: system  !! with its forces at the present displacements
    real(wp), intent(in) :: t             !! time of the loads [s]
    type(krylov_type), intent(inout) :: krylov
      !! with the preconditioner; gets the residual, 0 where held
    type(sums_type), intent(out) :: sums  !! over the residual and the supports; nothing has moved

    krylov%residual = system%state%force
    call add_loads(system, t, 1.0_wp, .false., krylov%residual)
    if (size(krylov%of_pins) > 0) then
      krylov%of_pins = drive_pins(system, krylov%frames, krylov%origin, krylov%residual)
    end if
    where (.not. krylov%inverse > 0.0_wp) krylov%residual = 0.0_wp
    ! a step of length 0 moves nothing and sums everything
    krylov%product = 0.0_wp
    call go_along(system, 0.0_wp, krylov, sums)
  end subroutine take_residual

  !> Start anew from the residual: the direction is the preconditioned residual.
  subroutine first_direction(system, krylov)
    type(system_type), intent(in) :: system  !! its volumes and horizon
    type(krylov_type), intent(inout) :: krylov
      !! with the residual; gets the direction and its scale
    real(wp) :: largest
    integer :: k, c

    largest = 0.0_wp
    do c = 1, size(krylov%residual, 2)
      !$omp parallel do simd schedule(static) default(none) shared(krylov, c) private(k) &
      !$omp reduction(max:largest)
      do k = 1, size(krylov%residual, 1)
        krylov%direction(k, c) = krylov%residual(k, c)*krylov%inverse(k, c)
        largest = max(largest, abs(krylov%direction(k, c)))
      end do
    end do
    largest = largest_of_ranks(system%body%order, largest)
    krylov%scale = 1.0_wp
    krylov%rho = volume_inner(system, krylov%residual, krylov%direction)
    if (size(krylov%of_pins) > 0) then
      call aim_pins(system, 1.0_wp, krylov, largest)
      krylov%rho = krylov%rho + sum(krylov%of_pins**2)
    end if
    call aim_slow(system, krylov, krylov%rho)
    call add_slow_answer(system, 1.0_wp, krylov, largest)
    krylov%norm = krylov%rho
    krylov%largest = largest
    krylov%ritz = ritz_type()
    if (largest > 0.0_wp) call rescale(krylov, direction_size*system%family%rule%delta/largest)
  end subroutine first_direction

  !> The next direction, conjugate to those before; `rho` belongs to the new residual.
  subroutine next_direction(system, rho, krylov)
    type(system_type), intent(in) :: system  !! its volumes and horizon
    real(wp), intent(in) :: rho  !! residual . preconditioned residual, weighted with volume
    type(krylov_type), intent(inout) :: krylov
      !! with the new residual and the last direction; gets the next one
    real(wp) :: beta, largest, scaled
    integer :: k, c

    scaled = krylov%scale*rho
    beta = scaled/krylov%rho
    krylov%ritz%beta = beta
    krylov%rho = scaled
    ! the preconditioned residual is conjugate with the old direction
    krylov%norm = krylov%scale*krylov%rho + beta**2*krylov%norm
    largest = 0.0_wp
    do c = 1, size(krylov%residual, 2)
      !$omp parallel do simd schedule(static) default(none) shared(krylov, c, beta) private(k) &
      !$omp reduction(max:largest)
      do k = 1, size(krylov%residual, 1)
        krylov%direction(k, c) = krylov%scale*krylov%residual(k, c)*krylov%inverse(k, c) &
          & + beta*krylov%direction(k, c)
        largest = max(largest, abs(krylov%direction(k, c)))
      end do
    end do
    largest = largest_of_ranks(system%body%order, largest)
    if (size(krylov%of_pins) > 0) then
      call aim_pins(system, krylov%scale, krylov, largest)
    end if
    call add_slow_answer(system, krylov%scale, krylov, largest)
    krylov%largest = largest
    if (largest > largest_size*system%family%rule%delta) &
      & call rescale(krylov, direction_size*system%family%rule%delta/largest)
  end subroutine next_direction

  !> Note that the iteration under way goes so far along its direction that the `curvature`
  !> (direction . stiffness . direction) asks for. The lengths make the Cholesky factor of the
  !> tridiagonal matrix
  !> that the iterations have projected the preconditioned stiffness to; the norm of its inverse is
  !> estimated by a column at a time (Duff and Voemel, BIT 42 (2002); Meurant and Tichy, Numer.
  !> Algorithms 82 (2019)). It never exceeds the true one, and soon comes near it.
  pure subroutine note_length(curvature, krylov)
    real(wp), intent(in) :: curvature            !! [N m]
    type(krylov_type), intent(inout) :: krylov   !! the solve; its estimate is brought up to date
    real(wp) :: length, ratio, inner, column, half, root, norm, share, rest

    associate (ritz => krylov%ritz)
      length = krylov%rho*krylov%scale/curvature
      if (.not. ritz%length > 0.0_wp) then
        ritz%softness = length
        ritz%inner = length
        ritz%last = length
      else
        ratio = sqrt(ritz%beta*length/ritz%length)
        column = ratio**2*ritz%last + length
        inner = -ratio*ritz%inner
        half = (ritz%softness - column)/2
        root = sqrt(half**2 + inner**2)
        ! the larger eigenvalue of [softness, inner; inner, column] and its vector (share, rest)
        share = merge(half + root, inner, half >= 0.0_wp)
        rest = merge(inner, root - half, half >= 0.0_wp)
        norm = sqrt(share**2 + rest**2)
        ritz%softness = (ritz%softness + column)/2 + root
        ritz%inner = column
        if (norm > 0.0_wp) ritz%inner = (share*inner + rest*column)/norm
        ritz%last = column
      end if
      ritz%length = length
    end associate
  end subroutine note_length

  !> Take a displacement for the direction; `scale` is 0 if it is none.
  subroutine take_direction(system, displacement, krylov)
    type(system_type), intent(in) :: system     !! its horizon
    real(wp), intent(in), contiguous :: displacement(:, :)  !! (n_slots, dim) [m]
    type(krylov_type), intent(inout) :: krylov  !! gets the direction, made small, and its scale
    real(wp) :: largest

    largest = largest_over(system%body%order, displacement)
    krylov%scale = 0.0_wp
    if (.not. largest > 0.0_wp) return
    krylov%direction = displacement
    krylov%scale = 1.0_wp
    krylov%largest = largest
    call rescale(krylov, direction_size*system%family%rule%delta/largest)
  end subroutine take_direction

  !> Multiply the directions.
  subroutine rescale(krylov, factor)
    type(krylov_type), intent(inout) :: krylov
    real(wp), intent(in) :: factor
    krylov%direction = factor*krylov%direction
    krylov%scale = factor*krylov%scale
    krylov%largest = factor*krylov%largest
    krylov%rho = factor*krylov%rho
    krylov%norm = factor**2*krylov%norm
  end subroutine rescale

  !> Linearise at the present displacements: they become the origin, and with `deformed` the tangent
  !> there takes the place of the undeformed stiffness.
  subroutine linearise(system, deformed, krylov)
    type(system_type), intent(inout) :: system
      !! at the displacements of the origin; its workspace changes
    logical, intent(in) :: deformed
      !! the tangent at these displacements, else the undeformed stiffness
    type(krylov_type), intent(inout) :: krylov
      !! gets the origin and, if `deformed`, the unprojected forces there

    krylov%origin = system%state%u
    krylov%deformed = deformed
    if (size(krylov%of_pins) > 0) call frame_pins(system, krylov%mass, krylov%origin, krylov%frames)
    if (.not. deformed) return
    if (.not. allocated(krylov%tangent%forces)) &
      & allocate (krylov%tangent%forces, mold=krylov%origin)
    call forces_at(system, krylov%origin, krylov%tangent%forces, forces_of(system, deformed))
  end subroutine linearise

  !> What the forces take in whose tangent is the stiffness. Those of a deformed body have the
  !> unprojected dilatation: they are a gradient, and their tangent is symmetric. At no displacement
  !> both dilatations have the same, symmetric stiffness, and heat has none.
  pure type(force_options_type) function forces_of(system, deformed) result(options)
    type(system_type), intent(in) :: system
    logical, intent(in) :: deformed

    options = options_of(system%model)
    options%projected = .not. deformed
    if (.not. deformed) options%thermal = .false.
  end function forces_of

  !> `product` = stiffness times `direction`, which may move constrained components, too. Either
  !> costs one evaluation of the forces, the undeformed stiffness (with the bonds that are intact
  !> now) by the fast formulas. The tangent is a one-sided difference, some seven digits: more than
  !> what isn't linear leaves to a solve.
  !> Terms of the force resist with the tangents that they give.
  subroutine apply_stiffness(system, krylov)
    type(system_type), intent(inout), target :: system
      !! its state stays as it is; its workspace changes
    type(krylov_type), intent(inout), target :: krylov  !! with the direction; gets the product
    type(term_view_type) :: view

    associate (tangent => krylov%tangent)
      tangent%options = forces_of(system, krylov%deformed)
      if (krylov%deformed) then
        tangent%difference = one_sided
        tangent%step = difference_size*system%family%rule%delta/krylov%largest
      else
        ! directions are so small that they need no other factor
        tangent%difference = about_undeformed
        tangent%step = 1.0_wp
      end if
    end associate
    call view_of(system, system%time, view, krylov%origin)
    call ask_bonds(system, view, tangent=krylov%tangent)
    call system%terms%add_tangent(view, krylov%direction, krylov%product)
    if (other_terms(system%terms) > 0) call share_halo(system%body, krylov%product)
  end subroutine apply_stiffness

  !> Go `length` along the direction: displacements, the forces that follow linearly, the residual,
  !> and the sums, in blocks of points.
  subroutine go_along(system, length, krylov, sums)
    type(system_type), intent(inout) :: system  !! its displacements and forces move on
    real(wp), intent(in) :: length              !! in units of the direction [-]
    type(krylov_type), intent(inout) :: krylov  !! with direction and product; its residual moves on
    type(sums_type), intent(out) :: sums        !! after the step
    type(summed_type) :: parts
    real(wp) :: terms(block_points, 4), taken(block_points, 7), totals(4)
    integer :: block, c, r, first, last, at

    call new_sums(system%body%order, 4, parts)
    !$omp parallel do schedule(static) default(none) shared(parts, system, krylov, length) &
    !$omp private(block, c, r, first, last, at, terms, taken)
    do block = 1, system%body%order%blocks
      ! whole blocks in runs are filled by the first component
      first = system%body%order%begin(block)
      last = system%body%order%begin(block + 1) - 1
      if (.not. system%body%order%in_runs) last = 0
      if (sum(system%body%order%run_length(first:last)) < block_points) terms = 0.0_wp
      do c = 1, size(krylov%residual, 2)
        if (system%body%order%in_runs) then
          do r = system%body%order%begin(block), system%body%order%begin(block + 1) - 1
            first = system%body%order%run_slot(r)
            last = first + system%body%order%run_length(r) - 1
            at = system%body%order%run_at(r)
            call go_run(last - first + 1, c == 1, length, system%body%volume(first:last), &
              & krylov%direction(first:last, c), krylov%product(first:last, c), &
              & krylov%inverse(first:last, c), system%state%u(first:last, c), &
              & system%state%force(first:last, c), krylov%residual(first:last, c), &
              & terms(at, 1), terms(at, 2), terms(at, 3), terms(at, 4))
          end do
          cycle
        end if
        associate (order => system%body%order)
          call take_block(order, block, system%body%volume, taken(:, 1))
          call take_block(order, block, krylov%direction(:, c), taken(:, 2))
          call take_block(order, block, krylov%product(:, c), taken(:, 3))
          call take_block(order, block, krylov%inverse(:, c), taken(:, 4))
          call take_block(order, block, system%state%u(:, c), taken(:, 5))
          call take_block(order, block, system%state%force(:, c), taken(:, 6))
          call take_block(order, block, krylov%residual(:, c), taken(:, 7))
          call go_run(block_points, c == 1, length, taken(:, 1), taken(:, 2), taken(:, 3), &
            & taken(:, 4), taken(:, 5), taken(:, 6), taken(:, 7), terms(1, 1), terms(1, 2), &
            & terms(1, 3), terms(1, 4))
          call put_block(order, block, taken(:, 5), system%state%u(:, c))
          call put_block(order, block, taken(:, 6), system%state%force(:, c))
          call put_block(order, block, taken(:, 7), krylov%residual(:, c))
        end associate
      end do
      call add_block(block, terms, parts)
    end do
    totals = total_of(system%body%order, parts)
    sums%residual = totals(1)
    sums%rho = totals(2)
    sums%change = totals(3)
    sums%displacement = totals(4)
    sums%support = force_of_supports(system)
    if (size(krylov%of_pins) > 0) then
      call go_pins(system, length, krylov, sums)
    end if
    call aim_slow(system, krylov, sums%rho)
    call share_halo(system%body, system%state%u)
  end subroutine go_along

  !> One component of points in consecutive slots; the terms of the sums are added to what other
  !> components have left, unless it is the `first`.
  pure subroutine go_run(n, first, length, volume, direction, product, inverse, u, force, &
    & residual, squared, rho, change, displacement)
    integer, intent(in) :: n
    logical, intent(in) :: first
    real(wp), intent(in) :: length
    real(wp), intent(in) :: volume(n), direction(n), product(n), inverse(n)
    real(wp), intent(inout) :: u(n), force(n), residual(n)
    real(wp), intent(inout) :: squared(n), rho(n), change(n), displacement(n)
    real(wp) :: free, left, now
    integer :: k

    if (first) then
      do k = 1, n
        free = merge(1.0_wp, 0.0_wp, inverse(k) > 0.0_wp)
        now = u(k) + length*direction(k)
        u(k) = now
        force(k) = force(k) - length*product(k)
        left = residual(k) - free*length*product(k)
        residual(k) = left
        squared(k) = (left*volume(k))**2
        rho(k) = volume(k)*left**2*inverse(k)
        change(k) = free*(length*direction(k))**2
        displacement(k) = free*now**2
      end do
      return
    end if
    do k = 1, n
      free = merge(1.0_wp, 0.0_wp, inverse(k) > 0.0_wp)
      now = u(k) + length*direction(k)
      u(k) = now
      force(k) = force(k) - length*product(k)
      left = residual(k) - free*length*product(k)
      residual(k) = left
      squared(k) = squared(k) + (left*volume(k))**2
      rho(k) = rho(k) + volume(k)*left**2*inverse(k)
      change(k) = change(k) + free*(length*direction(k))**2
      displacement(k) = displacement(k) + free*now**2
    end do
  end subroutine go_run

  !> (V F).(V F) over the constrained components.
  real(wp) function force_of_supports(system) result(squared)
    type(system_type), intent(in) :: system
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: m, c, i, k

    squared = 0.0_wp
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        if (all(motion%held == 0_i1) .and. .not. associated(system%body%order%ranks)) cycle
        call new_running(running)
        do i = 1, size(motion%slots)
          k = motion%slots(i)
          do c = 1, size(motion%held, 2)
            if (motion%held(i, c) == 1_i1) call add_point(system%body%order, system%body%point(k), &
              & [(system%state%force(k, c)*system%body%volume(k))**2], running)
          end do
        end do
        totals = total_of_running(system%body%order, running)
        squared = squared + totals(1)
      end associate
    end do
  end function force_of_supports

  !> Sum of V a b over all components.
  function volume_inner(system, a, b) result(sum_of_all)
    type(system_type), intent(in) :: system               !! its volumes
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)  !! (n_slots, dim) fields
    real(wp) :: sum_of_all
    sum_of_all = inner(system%body%order, system%body%volume, a, b)
  end function volume_inner

end module pd_motion_static_krylov
