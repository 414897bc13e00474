!> Pins in static equilibrium: what of a force drives the free rigid motions of a pin's points, and
!> what its stiffness bears (doc/theory.md, 7 and 10).
!>
!> The rigid motions that are free at a configuration are made orthonormal in the inner product that
!> is weighted with volume and preconditioner. The preconditioned residual of a pin is then the sum
!> of these motions, each times the inner product of the force with it.
module pd_motion_static_pins
  use pd_base_eigen, only: eigenvectors
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: add_point, largest_of_ranks, new_running, running_type, total_of_running
  use pd_base_text, only: to_text
  use pd_motion_conditions, only: free_component, motion_type
  use pd_motion_newton, only: frame_type, krylov_type, sums_type
  use pd_motion_pins, only: has_pins
  use pd_motion_static_pieces, only: piece_text
  use pd_motion_static_rigid, only: motion_at, rigid_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: frame_pins, drive_pins, add_drive, squares_of, go_pins, aim_pins
  public :: check_pins

  real(wp), parameter :: no_motion = 1.0e-10_wp  !! weight of a motion that moves no point, relative

contains

  !> The free rigid motions of every pin at displacements `u`; none for other boundaries.
  subroutine frame_pins(system, mass, u, frames)
    type(system_type), intent(in) :: system  !! its motions
    real(wp), intent(in) :: mass(:, :)       !! (n_slots, dim) preconditioner [N/m4]
    real(wp), intent(in) :: u(:, :)          !! (n_slots, dim) displacements [m]
    type(frame_type), allocatable, intent(out) :: frames(:)  !! (motions)
    integer :: m

    allocate (frames(size(system%motions)))
    do m = 1, size(frames)
      if (system%motions(m)%is_pin) call frame_pin(system, system%motions(m), mass, u, frames(m))
    end do
  end subroutine frame_pins

  !> One pin.
  subroutine frame_pin(system, motion, mass, u, frame)
    type(system_type), intent(in) :: system
    type(motion_type), intent(in) :: motion
    real(wp), intent(in) :: mass(:, :), u(:, :)
    type(frame_type), intent(out) :: frame
    type(running_type) :: running, of_gram(6)
    real(wp) :: gram(6, 6), values(6), vectors(6, 6), mode(6), totals(6)
    integer :: i, k, c, n, dim

    dim = system%body%dim
    associate (body => system%body)
      call new_running(running)
      do i = 1, size(motion%slots)
        k = motion%slots(i)
        call add_point(body%order, body%point(k), &
          & motion%pose%masses(i)*(body%x(k, :) + u(k, :)), running)
      end do
      totals = total_of_running(body%order, running)
      frame%centre(:dim) = totals(:dim)/motion%pose%mass
      frame%size = largest_of_ranks(body%order, max(maxval(norm2(motion%pose%arms, dim=1)), &
        & maxval(body%spacing(motion%slots))))
      do n = 1, 6
        call new_running(of_gram(n))
      end do
      do i = 1, size(motion%slots)
        k = motion%slots(i)
        do c = 1, dim
          if (.not. mass(k, c) > 0.0_wp) cycle
          mode = mode_of(frame, motion, body%x(k, :) + u(k, :), c)
          do n = 1, 6
            call add_point(body%order, body%point(k), body%volume(k)*mass(k, c)*mode(n)*mode, &
              & of_gram(n))
          end do
        end do
      end do
      do n = 1, 6
        gram(:, n) = total_of_running(body%order, of_gram(n))
      end do
    end associate
    call eigenvectors(gram, values, vectors)
    do n = 1, 6
      if (.not. values(n) > no_motion*maxval(values)) cycle
      frame%number = frame%number + 1
      frame%combination(:, frame%number) = vectors(:, n)/sqrt(values(n))
    end do
  end subroutine frame_pin

  !> Component `c` of the unit motions at a place, 0 for those that are imposed.
  pure function mode_of(frame, motion, place, c) result(mode)
    type(frame_type), intent(in) :: frame
    type(motion_type), intent(in) :: motion
    real(wp), intent(in) :: place(:)   !! (dim) [m]
    integer, intent(in) :: c
    real(wp) :: mode(6)

    mode = motion_at(frame%centre, frame%size, place, c)
    where (motion%kind /= free_component) mode(:3) = 0.0_wp
  end function mode_of

  !> How much a force density drives each free motion of every pin (6, motions).
  function drive_pins(system, frames, u, density) result(drives)
    type(system_type), intent(in) :: system
    type(frame_type), intent(in) :: frames(:)   !! (motions) of displacements `u`
    real(wp), intent(in) :: u(:, :)             !! (n_slots, dim) [m]
    real(wp), intent(in) :: density(:, :)       !! (n_slots, dim) force density [N/m3]
    real(wp) :: drives(6, size(frames))
    type(running_type) :: running
    real(wp) :: mode(6)
    integer :: m, i, k, c

    drives = 0.0_wp
    do m = 1, size(frames)
      if (frames(m)%number == 0) cycle
      associate (motion => system%motions(m), body => system%body)
        call new_running(running)
        do i = 1, size(motion%slots)
          k = motion%slots(i)
          mode = 0.0_wp
          do c = 1, body%dim
            mode = mode + mode_of(frames(m), motion, body%x(k, :) + u(k, :), c)*density(k, c)
          end do
          call add_point(body%order, body%point(k), body%volume(k)*mode, running)
        end do
        drives(:, m) = matmul(total_of_running(body%order, running), frames(m)%combination)
      end associate
    end do
  end function drive_pins

  !> Add the motions that are driven to a field, times `factor` and, if it is there, the
  !> preconditioner: the force density that is left over on the points of pins.
  subroutine add_drive(system, frames, u, drives, factor, field, mass)
    type(system_type), intent(in) :: system
    type(frame_type), intent(in) :: frames(:)   !! (motions) of displacements `u`
    real(wp), intent(in) :: u(:, :)             !! (n_slots, dim) [m]
    real(wp), intent(in) :: drives(:, :)        !! (6, motions)
    real(wp), intent(in) :: factor              !! factor
    real(wp), intent(inout) :: field(:, :)      !! (n_slots, dim) added to on the points of pins
    real(wp), intent(in), optional :: mass(:, :)  !! (n_slots, dim) preconditioner [N/m4]
    real(wp) :: by, motion_of(6)
    integer :: m, i, k, c

    do m = 1, size(frames)
      if (frames(m)%number == 0) cycle
      motion_of = matmul(frames(m)%combination, drives(:, m))
      do i = 1, size(system%motions(m)%slots)
        k = system%motions(m)%slots(i)
        do c = 1, system%body%dim
          by = factor
          if (present(mass)) by = factor*mass(k, c)
          field(k, c) = field(k, c) + by*dot_product(motion_of, mode_of(frames(m), &
            & system%motions(m), system%body%x(k, :) + u(k, :), c))
        end do
      end do
    end do
  end subroutine add_drive

  !> Sum of the squares of `field` over the points of pin `m`, weighted with volume if `weighted`.
  real(wp) function squares_of(system, m, field, weighted) result(squares)
    type(system_type), intent(in) :: system
    integer, intent(in) :: m                !! number of the boundary
    real(wp), intent(in) :: field(:, :)     !! (n_slots, dim)
    logical, intent(in) :: weighted         !! field times volume
    type(running_type) :: running
    real(wp) :: totals(6), weight
    integer :: i, k

    call new_running(running)
    do i = 1, size(system%motions(m)%slots)
      k = system%motions(m)%slots(i)
      weight = 1.0_wp
      if (weighted) weight = system%body%volume(k)
      call add_point(system%body%order, system%body%point(k), [sum((weight*field(k, :))**2)], &
        & running)
    end do
    totals = total_of_running(system%body%order, running)
    squares = totals(1)
  end function squares_of

  !> The part of pins in a step of `length` along the direction: their residual moves on, and the
  !> sums get what they add.
  subroutine go_pins(system, length, krylov, sums)
    type(system_type), intent(in) :: system     !! after the step
    real(wp), intent(in) :: length              !! in units of the direction [-]
    type(krylov_type), intent(inout) :: krylov  !! with direction and product
    type(sums_type), intent(inout) :: sums      !! of the other points, added to
    real(wp), allocatable :: left(:, :)
    integer :: m

    krylov%of_pins = krylov%of_pins - length*drive_pins(system, krylov%frames, krylov%origin, &
      & krylov%product)
    allocate (left(size(krylov%mass, 1), size(krylov%mass, 2)), source=0.0_wp)
    call add_drive(system, krylov%frames, krylov%origin, krylov%of_pins, 1.0_wp, left, krylov%mass)
    do m = 1, size(krylov%frames)
      if (krylov%frames(m)%number == 0) cycle
      sums%residual = sums%residual + squares_of(system, m, left, .true.)
      sums%rho = sums%rho + sum(krylov%of_pins(:, m)**2)
      sums%change = sums%change + length**2*squares_of(system, m, krylov%direction, .false.)
      sums%displacement = sums%displacement + squares_of(system, m, system%state%u, .false.)
    end do
  end subroutine go_pins

  !> Add the preconditioned residual of pins to a direction, times `factor`; `largest` is the
  !> largest component then.
  subroutine aim_pins(system, factor, krylov, largest)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: factor
    type(krylov_type), intent(inout) :: krylov  !! its direction is added to
    real(wp), intent(inout) :: largest          !! of the direction [m]
    integer :: m

    call add_drive(system, krylov%frames, krylov%origin, krylov%of_pins, factor, krylov%direction)
    do m = 1, size(krylov%frames)
      if (krylov%frames(m)%number == 0) cycle
      largest = max(largest, largest_of_ranks(system%body%order, &
        & maxval(abs(krylov%direction(system%motions(m)%slots, :)))))
    end do
  end subroutine aim_pins

  !> An error if a pin joins pieces that no bond joins, or if a piece with a pin is free to move as
  !> a whole: its equilibrium would not be unique. `status` is that of the error.
  subroutine check_pins(system, rigid, status, error)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid    !! as `find_free_motions` found it
    integer, intent(in) :: status            !! exit status of the error
    type(error_type), allocatable, intent(out) :: error
    integer :: m, p

    if (.not. has_pins(system)) return
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        if (.not. motion%is_pin) cycle
        p = rigid%first_of_pin(m)
        if (rigid%last_of_pin(m) > p) then
          call fail(error, 'the pin of &boundary number '//to_text(m)//' holds points of '// &
            & 'several pieces that no bond joins: in static equilibrium a pin lies in one piece', &
            & status, 'boundary', m)
          return
        end if
        if (rigid%piece(p)%number == 0) cycle
        call fail(error, piece_text(system%body, rigid%pieces, p)//', with the pin of '// &
          & '&boundary number '//to_text(m)//', is free to move as a whole in '// &
          & to_text(rigid%piece(p)%number)//' way(s): it has no unique static equilibrium. '// &
          & 'Support it, as by displacement_x = 0 of a pin', status, 'boundary', m)
        return
      end associate
    end do
  end subroutine check_pins

end module pd_motion_static_pins
