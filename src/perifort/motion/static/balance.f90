!> Whether a state is in static equilibrium, piece by piece (doc/theory.md, 7): what is out of
!> balance beside what acts, whether reactions and loads balance, and how far the displacements may
!> be off.
module pd_motion_static_balance
  use pd_base_kinds, only: wp, i1
  use pd_base_order, only: ascending_order
  use pd_base_reduce, only: add_point, largest_of_ranks, largest_over, new_running, running_type, &
    & total_of_running
  use pd_base_error, only: error_type, fail, status_no_answer
  use pd_base_text, only: newline, to_text
  use pd_force_forces, only: energy_pass
  use pd_motion_newton, only: frame_type, krylov_type
  use pd_motion_pins, only: has_pins
  use pd_motion_static_pins, only: add_drive, drive_pins, frame_pins, squares_of
  use pd_motion_watch_fault, only: place
  use pd_motion_static_pieces, only: piece_text
  use pd_motion_static_residual, only: relaxation_type, squared_force
  use pd_motion_static_rigid, only: rigid_type, fit_rigid_motion
  use pd_force_term, only: term_view_type
  use pd_motion_system, only: add_loads, ask_bonds, system_type, view_of
  use pd_motion_tangent, only: forces_at
  implicit none (type, external)
  private
  public :: balance_type, begin_balance, weigh, weigh_energies, weigh_slow, balanced_but_for_error
  public :: allowed_error, error_is_known, relative_residual, describe_left_over
  public :: fail_unconverged, check_drowned, rounding_note

  !> What is out of balance in one piece. Norms of forces are squared, over components: [N2].
  type :: tally_type
    real(wp) :: residual = 0.0_wp       !! of the free components
    real(wp) :: support = 0.0_wp        !! of the constrained components
    real(wp) :: load = 0.0_wp           !! of the loads
    real(wp) :: thermal = 0.0_wp        !! of the forces of the undeformed body, heated
    real(wp) :: rounding = 0.0_wp       !! of what rounding of the displacements leaves
    real(wp) :: rho = 0.0_wp            !! residual . (residual/mass), weighted with volume [N m]
    real(wp) :: slow = 0.0_wp           !! what the preconditioner's coarse part adds to it [N m]
    real(wp) :: rho_rounding = 0.0_wp   !! the same of what rounding leaves [N m]
    real(wp) :: left(3) = 0.0_wp        !! loads and reactions together [N]
    real(wp) :: moment(3) = 0.0_wp      !! their moment about the piece's centre [N m]
    real(wp) :: force_scale = 0.0_wp    !! largest net force of a boundary or a load [N]
    real(wp) :: moment_scale = 0.0_wp   !! largest net moment of one [N m]
    logical :: loaded = .false.         !! its loads have a net force or moment
    real(wp) :: energy = 0.0_wp         !! twice the strain energy [J]
  end type tally_type

  !> All pieces, and what is the same for all states of a load step.
  type :: balance_type
    type(tally_type), allocatable :: piece(:)
    real(wp), allocatable :: thermal(:)         !! as in `tally_type`
    real(wp), allocatable :: thermal_energy(:)  !! twice the energy of the undeformed body, heated
    real(wp) :: acting = 0.0_wp  !! squared norm of loads or thermal forces, all pieces
  end type balance_type

  !> Share of the largest net force, and moment, that reactions and loads may leave over.
  real(wp), parameter :: left_over = 2.0e-4_wp
  !> ... and what they may leave where rounding lets nothing better be had.
  real(wp), parameter :: most_left_over = 1.0e-3_wp
  !> Imposed displacements are those of a rigid body if they differ by no more than this part.
  real(wp), parameter :: rigid_to = 1.0e-13_wp
  !> Net force or moment of loads, over the applied ones, that counts as none.
  real(wp), parameter :: no_net = 1.0e-10_wp
  !> Rounding of a force: so many units in the last place of a displacement times the stiffness of a
  !> point, which bounds its row (doc/theory.md, 6).
  real(wp), parameter :: last_places = 8.0_wp
  !> That is a bound. What rounding does leave is nearer to this part of it, since the errors of a
  !> point's bonds are of either sign: so far a residual can be brought beside what acts.
  real(wp), parameter :: likely = 0.0125_wp
  !> What acts must be so many times the bound: then what is left is a thousandth.
  real(wp), parameter :: audible = 1.0e3_wp*likely

contains

  !> What is the same for all states at time `t`: the forces and energies that heat alone makes, and
  !> the norm of what acts.
  subroutine begin_balance(system, rigid, t, balance)
    type(system_type), intent(inout) :: system   !! a body with its conditions
    type(rigid_type), intent(in) :: rigid        !! its pieces
    real(wp), intent(in) :: t                    !! time [s]
    type(balance_type), intent(out) :: balance   !! ready for `weigh`
    real(wp), allocatable :: none(:, :), force(:, :), energy(:)
    real(wp) :: totals(6)
    integer :: p

    allocate (balance%piece(rigid%pieces%number))
    allocate (balance%thermal(rigid%pieces%number), balance%thermal_energy(rigid%pieces%number), &
      & source=0.0_wp)
    allocate (force(system%body%n_slots, system%body%dim), source=0.0_wp)
    call add_loads(system, t, 1.0_wp, .false., force)
    balance%acting = squared_force(system, force, held=.true.)
    if (system%terms%inside > 0) then
      call forces_of_terms(system, t, force)
      balance%acting = max(balance%acting, squared_force(system, force, held=.true.))
    end if
    if (.not. system%model%thermal) return
    allocate (none, mold=force)
    allocate (energy(system%body%n_slots), source=0.0_wp)
    none = 0.0_wp
    call forces_at(system, none, force)
    call energy_pass(system%family, system%model, system%workspace, none, energy)
    do p = 1, rigid%pieces%number
      totals = of_piece(p)
      balance%thermal(p) = totals(1)
      balance%thermal_energy(p) = totals(2)
    end do
    balance%acting = max(balance%acting, sum(balance%thermal))

  contains

    !> Squared forces and energy of a piece.
    function of_piece(number) result(sums)
      integer, intent(in) :: number
      real(wp) :: sums(6)
      type(running_type) :: running
      integer :: i, k

      call new_running(running)
      do i = rigid%pieces%start(number), rigid%pieces%start(number + 1) - 1
        k = rigid%pieces%slots(i)
        call add_point(system%body%order, system%body%point(k), &
          & [sum((force(k, :)*system%body%volume(k))**2), &
          & 2*abs(energy(k))*system%body%volume(k)], running)
      end do
      sums = total_of_running(system%body%order, running)
    end function of_piece
  end subroutine begin_balance

  !> Force density of the terms that are not external, at the present displacements: what they bear
  !> is support, as that of constrained components, and in balance with loads and reactions.
  subroutine forces_of_terms(system, t, force)
    type(system_type), intent(in), target :: system
    real(wp), intent(in) :: t                     !! time [s]
    real(wp), intent(out), contiguous :: force(:, :)  !! (n_slots, dim) [N/m3]
    type(term_view_type) :: view

    force = 0.0_wp
    call view_of(system, t, view)
    call system%terms%add_force(view, force)
  end subroutine forces_of_terms

  !> Sum up the state of every piece at time `t`; the forces of the system must belong to its
  !> displacements.
  subroutine weigh(system, relaxation, rigid, t, balance)
    type(system_type), intent(in) :: system           !! a state
    type(relaxation_type), intent(in) :: relaxation   !! how it is relaxed
    type(rigid_type), intent(in) :: rigid             !! its pieces
    real(wp), intent(in) :: t                         !! time [s]
    type(balance_type), intent(inout) :: balance      !! gets the sums
    real(wp), allocatable :: loads(:, :), borne(:, :)
    type(running_type) :: running
    real(wp) :: squared, floor, terms(6)
    integer :: i, k, c, p

    do p = 1, size(balance%piece)
      balance%piece(p) = tally_type()
      balance%piece(p)%thermal = balance%thermal(p)
    end do
    allocate (loads(system%body%n_slots, system%body%dim), source=0.0_wp)
    call add_loads(system, t, 1.0_wp, .false., loads)
    do p = 1, size(balance%piece)
      call new_running(running)
      do i = rigid%pieces%start(p), rigid%pieces%start(p + 1) - 1
        k = rigid%pieces%slots(i)
        terms = 0.0_wp
        associate (volume => system%body%volume(k))
          do c = 1, system%body%dim
            terms(1) = terms(1) + (loads(k, c)*volume)**2
            squared = ((system%state%force(k, c) + loads(k, c))*volume)**2
            if (system%held(k, c) == 1_i1) then
              terms(2) = terms(2) + squared
            else
              terms(3) = terms(3) + squared
            end if
            if (.not. relaxation%mass(k, c) > 0.0_wp) cycle
            ! the mass is half the bound of the stiffness
            floor = last_places*epsilon(floor)*norm2(system%state%u(k, :)) &
              & *2*relaxation%mass(k, c)*volume
            terms(4) = terms(4) + floor**2
            terms(5) = terms(5) + floor**2/(relaxation%mass(k, c)*volume)
            if (system%held(k, c) == 0_i1) terms(6) = terms(6) &
              & + squared/(relaxation%mass(k, c)*volume)
          end do
        end associate
        call add_point(system%body%order, system%body%point(k), terms, running)
      end do
      terms = total_of_running(system%body%order, running)
      associate (piece => balance%piece(p))
        piece%load = terms(1)
        piece%support = terms(2)
        piece%residual = terms(3)
        piece%rounding = terms(4)
        piece%rho_rounding = terms(5)
        piece%rho = terms(6)
      end associate
    end do
    if (has_pins(system)) call weigh_pins(system, relaxation, rigid, loads, balance)
    allocate (borne, mold=loads)
    if (system%terms%inside > 0) then
      call forces_of_terms(system, t, borne)
      do p = 1, size(balance%piece)
        call new_running(running)
        do i = rigid%pieces%start(p), rigid%pieces%start(p + 1) - 1
          k = rigid%pieces%slots(i)
          call add_point(system%body%order, system%body%point(k), &
            & [sum((borne(k, :)*system%body%volume(k))**2)], running)
        end do
        terms = total_of_running(system%body%order, running)
        balance%piece(p)%support = balance%piece(p)%support + terms(1)
      end do
    end if
    call add_groups(system, rigid, loads, borne, balance)
  end subroutine weigh

  !> What drives the free motions of pins is residual; of all forces on their points, which count as
  !> support, it is the part that no rigidity bears.
  subroutine weigh_pins(system, relaxation, rigid, loads, balance)
    type(system_type), intent(in) :: system
    type(relaxation_type), intent(in) :: relaxation
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: loads(:, :)           !! (n_slots, dim) force density [N/m3]
    type(balance_type), intent(inout) :: balance  !! gets what is out of balance
    type(frame_type), allocatable :: frames(:)
    real(wp), allocatable :: drives(:, :), left(:, :)
    integer :: m

    associate (u => system%state%u)
      call frame_pins(system, relaxation%mass, u, frames)
      drives = drive_pins(system, frames, u, system%state%force + loads)
      allocate (left(size(u, 1), size(u, 2)), source=0.0_wp)
      call add_drive(system, frames, u, drives, 1.0_wp, left, relaxation%mass)
    end associate
    do m = 1, size(frames)
      if (frames(m)%number == 0) cycle
      associate (piece => balance%piece(rigid%first_of_pin(m)))
        piece%residual = piece%residual + squares_of(system, m, left, .true.)
        piece%rho = piece%rho + sum(drives(:, m)**2)
      end associate
    end do
  end subroutine weigh_pins

  !> Net forces and moments of each boundary, of the terms of the force and of the loads on every
  !> piece, and their sums.
  subroutine add_groups(system, rigid, loads, borne, balance)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: loads(:, :)
    real(wp), intent(in) :: borne(:, :)   !! by the terms of the force that are not external, if any
    type(balance_type), intent(inout) :: balance
    type(running_type) :: running, of_applied
    integer, allocatable :: order(:)
    real(wp) :: one(3), net(6), applied(6)
    integer :: m, i, p, dim, k, next

    dim = system%body%dim
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        ! piece by piece, each in the order of points
        order = ascending_order(rigid%pieces%of(motion%slots))
        next = 1
        do p = 1, size(balance%piece)
          call new_running(running)
          i = next
          do while (next <= size(order))
            k = motion%slots(order(next))
            if (rigid%pieces%of(k) /= p) exit
            one = 0.0_wp
            where (motion%held(order(next), :) == 1_i1) &
              & one(:dim) = -(system%state%force(k, :) + loads(k, :))*system%body%volume(k)
            call add_one(k, one)
            next = next + 1
          end do
          if (next > i .or. associated(system%body%order%ranks)) call add_net()
        end do
      end associate
    end do
    do p = 1, size(balance%piece)
      if (system%terms%inside > 0) then
        call new_running(running)
        do i = rigid%pieces%start(p), rigid%pieces%start(p + 1) - 1
          k = rigid%pieces%slots(i)
          one = 0.0_wp
          one(:dim) = borne(k, :)*system%body%volume(k)
          call add_one(k, one)
        end do
        call add_net()
      end if
      call new_running(running)
      call new_running(of_applied)
      do i = rigid%pieces%start(p), rigid%pieces%start(p + 1) - 1
        k = rigid%pieces%slots(i)
        if (all(abs(loads(k, :)) <= 0.0_wp)) cycle
        one = 0.0_wp
        one(:dim) = loads(k, :)*system%body%volume(k)
        call add_one(k, one)
        call add_point(system%body%order, system%body%point(k), [norm2(one)], of_applied)
      end do
      call add_net()
      applied = total_of_running(system%body%order, of_applied)
      balance%piece(p)%loaded = norm2(net(:3)) > no_net*applied(1) .or. &
        & norm2(net(4:)) > no_net*applied(1)*rigid%piece(p)%size
    end do

  contains

    !> A force on a slot of piece `p`.
    subroutine add_one(slot, value)
      integer, intent(in) :: slot
      real(wp), intent(in) :: value(3)
      real(wp) :: arm(3)

      arm = 0.0_wp
      arm(:dim) = system%body%x(slot, :) + system%state%u(slot, :) - rigid%piece(p)%centre(:dim)
      call add_point(system%body%order, system%body%point(slot), [value, arm(2)*value(3) &
        & - arm(3)*value(2), arm(3)*value(1) - arm(1)*value(3), arm(1)*value(2) &
        & - arm(2)*value(1)], running)
    end subroutine add_one

    !> A group is complete on piece `p`.
    subroutine add_net()
      net = total_of_running(system%body%order, running)
      associate (piece => balance%piece(p))
        piece%left = piece%left + net(:3)
        piece%moment = piece%moment + net(4:)
        piece%force_scale = max(piece%force_scale, norm2(net(:3)))
        piece%moment_scale = max(piece%moment_scale, norm2(net(4:)))
      end associate
    end subroutine add_net
  end subroutine add_groups

  !> Twice the stored energy of every piece, or that of its heat alone if that is larger.
  subroutine weigh_energies(system, rigid, balance)
    type(system_type), intent(inout), target :: system
      !! at the state that is weighed; its workspace changes
    type(rigid_type), intent(in) :: rigid         !! its pieces
    type(balance_type), intent(inout) :: balance  !! gets the energy of every piece
    type(term_view_type) :: view
    real(wp), allocatable :: energy(:)
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: i, k, p

    allocate (energy(system%body%n_slots), source=0.0_wp)
    call view_of(system, system%time, view)
    call ask_bonds(system, view)
    call system%terms%add_energy(view, energy)
    do p = 1, size(balance%piece)
      call new_running(running)
      do i = rigid%pieces%start(p), rigid%pieces%start(p + 1) - 1
        k = rigid%pieces%slots(i)
        call add_point(system%body%order, system%body%point(k), &
          & [2*energy(k)*system%body%volume(k)], running)
      end do
      totals = total_of_running(system%body%order, running)
      balance%piece(p)%energy = totals(1)
    end do
    balance%piece%energy = max(abs(balance%piece%energy), balance%thermal_energy)
  end subroutine weigh_energies

  !> The square of what residuals of a piece are parts of: the largest of the norms of support
  !> forces, loads and thermal forces.
  elemental real(wp) function scale_of(piece) result(squared)
    type(tally_type), intent(in) :: piece
    squared = max(piece%support, piece%load, piece%thermal)
  end function scale_of

  !> Whether what acts on a piece, if anything does, cannot be distinguished from rounding.
  elemental logical function silent(piece)
    type(tally_type), intent(in) :: piece
    silent = scale_of(piece) < audible**2*piece%rounding
  end function silent

  !> Whether a piece's residual is what rounding leaves.
  elemental logical function at_the_floor(piece)
    type(tally_type), intent(in) :: piece
    at_the_floor = piece%residual <= piece%rounding*merge(1.0_wp, likely**2, silent(piece))
  end function at_the_floor

  !> Whether residual force and net forces and moments of a piece are small enough, or as small as
  !> rounding lets them be.
  elemental logical function piece_balanced(relaxation, rigid_size, piece) result(balanced)
    type(relaxation_type), intent(in) :: relaxation
    real(wp), intent(in) :: rigid_size   !! extent of the piece [m]
    type(tally_type), intent(in) :: piece

    balanced = at_the_floor(piece)
    if (silent(piece)) then
      balanced = balanced .or. piece%residual <= relaxation%tolerance**2*scale_of(piece)
      return
    end if
    ! of a state whose supports bear nothing but what is out of balance, the ratio is near 1
    balanced = balanced .or. piece%residual <= relaxation%tolerance**2*scale_of(piece)
    if (.not. balanced) return
    balanced = net_balanced(relaxation%tolerance, left_over, rigid_size, piece) .or. &
      & piece%residual <= likely**2*piece%rounding
  end function piece_balanced

  !> Whether loads and reactions of a piece leave no more than `share` of the largest net force, and
  !> moment, of a boundary or of the loads. Where no load has one, reactions may vanish, as those of
  !> a heated body that can expand; the residual is then all there is to go by.
  elemental logical function net_balanced(tolerance, share, rigid_size, piece) result(balanced)
    real(wp), intent(in) :: tolerance    !! of the residual [-]
    real(wp), intent(in) :: share        !! [-]
    real(wp), intent(in) :: rigid_size   !! extent of the piece [m]
    type(tally_type), intent(in) :: piece
    real(wp) :: force, moment

    force = share*max(piece%force_scale, piece%moment_scale/rigid_size)
    if (.not. piece%loaded) force = max(force, tolerance*sqrt(scale_of(piece)))
    moment = max(share*piece%moment_scale, force*rigid_size)
    balanced = norm2(piece%left) <= force .and. norm2(piece%moment) <= moment
  end function net_balanced

  !> Whether the forces of every piece are in balance as weighed; what remains to be known is how
  !> far off its displacements are.
  pure logical function balanced_but_for_error(relaxation, rigid, balance) result(balanced)
    type(relaxation_type), intent(in) :: relaxation  !! with the tolerance
    type(rigid_type), intent(in) :: rigid            !! its pieces
    type(balance_type), intent(in) :: balance        !! as weighed
    balanced = all(piece_balanced(relaxation, rigid%piece%size, balance%piece))
  end function balanced_but_for_error

  !> The error energy (error . stiffness . error) that each piece's displacements may have (pieces)
  !> [J]: relative to the strain energy its root is 100 times the tolerance, and at most 1e-3.
  pure function allowed_error(relaxation, balance) result(allowed)
    type(relaxation_type), intent(in) :: relaxation  !! with the tolerance
    type(balance_type), intent(in) :: balance        !! as weighed, with energies
    real(wp), allocatable :: allowed(:)
    allocate (allowed(size(balance%piece)), source= &
      & min(1.0e-3_wp, 100*relaxation%tolerance)**2*balance%piece%energy)
  end function allowed_error

  !> Whether the displacements of every piece are known to be near enough to equilibrium: the error
  !> energy is at most the residual's `rho` times the softness of the preconditioned stiffness, if
  !> that is known (> 0). Where only rounding is left nothing more can be had.
  pure logical function error_is_known(balance, softness, allowed)
    type(balance_type), intent(in) :: balance   !! with energies
    real(wp), intent(in) :: softness            !! [-]
    real(wp), intent(in) :: allowed(:)          !! error energy of each piece [J]
    error_is_known = all(balance%piece%rho &
      & <= balance%piece%rho_rounding*merge(1.0_wp, likely**2, silent(balance%piece)) .or. &
      & (softness > 0.0_wp .and. (balance%piece%rho + balance%piece%slow)*softness <= allowed))
  end function error_is_known

  !> Note what the coarse part of a preconditioner adds to the residual's `rho` of every piece.
  subroutine weigh_slow(system, rigid, krylov, balance)
    type(system_type), intent(in) :: system       !! whose memory has the coarse part
    type(rigid_type), intent(in) :: rigid         !! its pieces
    type(krylov_type), intent(in) :: krylov       !! with the residual of the state weighed
    type(balance_type), intent(inout) :: balance  !! as weighed
    integer :: i, p

    balance%piece%slow = 0.0_wp
    if (.not. allocated(krylov%slow)) return
    do i = 1, size(krylov%slow)
      p = rigid%pieces%of(system%memory%coarse%slot_of(i))
      balance%piece(p)%slow = balance%piece(p)%slow + krylov%on_slow(i)*krylov%slow(i)
    end do
  end subroutine weigh_slow

  !> The largest relative residual of all pieces; 0 where nothing but rounding is left.
  pure real(wp) function relative_residual(balance) result(residual)
    type(balance_type), intent(in) :: balance  !! as weighed
    residual = maxval(relative_to_scale(balance%piece))
  end function relative_residual

  elemental real(wp) function relative_to_scale(piece) result(relative)
    type(tally_type), intent(in) :: piece
    relative = 0.0_wp
    if (piece%residual <= 0.0_wp) return
    if (at_the_floor(piece) .and. silent(piece)) return
    relative = sqrt(piece%residual/max(scale_of(piece), tiny(1.0_wp)))
  end function relative_to_scale

  !> The piece that is farthest from balance.
  pure integer function worst_piece(balance) result(worst)
    type(balance_type), intent(in) :: balance
    worst = maxloc(relative_to_scale(balance%piece), dim=1)
  end function worst_piece

  !> The error of a relaxation whose iterations are used up; `balance` is where it stands.
  subroutine fail_unconverged(system, relaxation, rigid, balance, load_step, t, change, error)
    type(system_type), intent(in) :: system          !! where its iterations ended
    type(relaxation_type), intent(in) :: relaxation  !! whose iterations are used up
    type(rigid_type), intent(in) :: rigid            !! its pieces
    type(balance_type), intent(in) :: balance   !! as weighed
    integer, intent(in) :: load_step            !! its number
    real(wp), intent(in) :: t                   !! its time [s]
    real(wp), intent(in) :: change              !! of displacement in the last iteration, relative
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: advice

    if (at_the_floor(balance%piece(worst_piece(balance)))) then
      advice = 'No less than '// &
        & to_text(likely*sqrt(balance%piece(worst_piece(balance))%rounding), 1)// &
        & ' N can be expected where forces are rounded. Move or heat the body by less, load it '// &
        & 'by more, or raise tolerance'
    else
      advice = 'Raise maximum_iterations or tolerance, or use more load steps'
    end if
    call fail(error, 'not converged: after '//to_text(relaxation%maximum_iterations)// &
      & ' iterations of load step '//to_text(load_step)//' the residual force is '// &
      & to_text(relative_residual(balance))//' and the change of displacement '//to_text(change)// &
      & ' (tolerance '//to_text(relaxation%tolerance)//'). '//advice//newline//'  '// &
      & describe_left_over(system, rigid, balance, worst_piece(balance), t), status_no_answer)
  end subroutine fail_unconverged

  !> What to say about an accepted state whose residual is above the tolerance, '' if it is not.
  function rounding_note(relaxation, balance) result(text)
    type(relaxation_type), intent(in) :: relaxation  !! with the tolerance
    type(balance_type), intent(in) :: balance   !! as weighed
    character(:), allocatable :: text

    text = ''
    if (relative_residual(balance) <= relaxation%tolerance) return
    text = 'the residual stops at '//to_text(relative_residual(balance), 2)//', above the '// &
      & 'tolerance of '//to_text(relaxation%tolerance)//', because forces are not formed more '// &
      & 'exactly; the state is accepted, since its error is known to be small'
  end function rounding_note

  !> An error if what acts on some piece vanishes in the rounding of its forces: then nothing is
  !> known of its equilibrium.
  subroutine check_drowned(system, relaxation, rigid, balance, error)
    type(system_type), intent(in) :: system          !! at the accepted state
    type(relaxation_type), intent(in) :: relaxation  !! with the tolerance
    type(rigid_type), intent(in) :: rigid            !! its pieces
    type(balance_type), intent(in) :: balance   !! as weighed, of an accepted state
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: text
    integer :: p

    do p = 1, size(balance%piece)
      associate (tally => balance%piece(p))
        if (silent(tally)) then
          ! a piece that is only moved, as a rigid body, is where it should be
          if (.not. max(tally%load, tally%thermal) > 0.0_wp) then
            if (.not. supports_strain(system, rigid, p)) cycle
          end if
          text = 'the forces that act on '//piece_text(system%body, rigid%pieces, p)//', '// &
            & to_text(sqrt(scale_of(tally)), 3)//' N, vanish in the rounding of its forces, '// &
            & to_text(sqrt(tally%rounding), 2)//' N'
        else
          if (.not. scale_of(tally) > 0.0_wp) cycle  ! nothing acts
          if (net_balanced(max(relaxation%tolerance, likely*sqrt(tally%rounding/scale_of(tally))), &
            & most_left_over, rigid%piece(p)%size, tally)) cycle
          text = 'loads and reactions of '//piece_text(system%body, rigid%pieces, p)// &
            & ', net forces of up to '//to_text(tally%force_scale, 3)//' N, leave a force of '// &
            & to_text(norm2(tally%left), 3)//' N because its forces are rounded,'
        end if
      end associate
      call fail(error, 'no static equilibrium can be computed: '//text// &
        & ' at displacements of up to '//to_text(largest_over(system%body%order, &
        & system%state%u), 3)// &
        & ' m. Move or heat it by less, or load it by more', &
        & status_no_answer)
      return
    end do
  end subroutine check_drowned

  !> Whether the imposed displacements of a piece are not those of a rigid body, to rounding.
  logical function supports_strain(system, rigid, p)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid
    integer, intent(in) :: p                    !! number of the piece
    real(wp), allocatable :: u(:, :), weight(:, :)

    associate (slots => rigid%pieces%slots(rigid%pieces%start(p):rigid%pieces%start(p + 1) - 1))
      supports_strain = .false.
      if (.not. rigid%piece(p)%held) return
      allocate (weight, source=real(system%held, wp))
      allocate (u(size(weight, 1), size(weight, 2)), source=0.0_wp)
      call fit_rigid_motion(system, rigid, p, system%state%u, weight, u)
      supports_strain = largest_of_ranks(system%body%order, maxval(weight(slots, :) &
        & *abs(u(slots, :) - system%state%u(slots, :)))) > rigid_to*largest_of_ranks( &
        & system%body%order, maxval(abs(system%state%u(slots, :))))
    end associate
  end function supports_strain

  !> What is left over in a piece and where, in words.
  function describe_left_over(system, rigid, balance, piece, t) result(text)
    type(system_type), intent(in) :: system      !! at the state that is weighed
    type(rigid_type), intent(in) :: rigid        !! its pieces
    type(balance_type), intent(in) :: balance    !! as weighed
    integer, intent(in) :: piece                 !! its number
    real(wp), intent(in) :: t                    !! time of the loads [s]
    character(:), allocatable :: text
    real(wp), allocatable :: loads(:, :)
    real(wp) :: largest, here
    integer :: i, k, at

    allocate (loads(system%body%n_slots, system%body%dim), source=0.0_wp)
    call add_loads(system, t, 1.0_wp, .false., loads)
    largest = -1.0_wp
    at = 0
    do i = rigid%pieces%start(piece), rigid%pieces%start(piece + 1) - 1
      k = rigid%pieces%slots(i)
      here = norm2(merge(system%state%force(k, :) + loads(k, :), 0.0_wp, &
        & system%held(k, :) == 0_i1))*system%body%volume(k)
      if (here > largest .or. at == 0) at = k
      largest = max(largest, here)
    end do
    associate (tally => balance%piece(piece))
      text = piece_text(system%body, rigid%pieces, piece)//' has '// &
        & to_text(sqrt(tally%residual), 3)//' N out of balance, most of it at point '// &
        & to_text(int(system%body%point(at)))//' at ('//place(system, at)// &
          & '); its supports bear '// &
        & to_text(sqrt(tally%support), 3)//' N, its loads are '//to_text(sqrt(tally%load), 3)// &
        & ' N (root sums of squares over the points), and together they leave a force of ('// &
        & vector(tally%left(:system%body%dim))//') N'
      if (system%body%dim == 2) text = text//' and a moment of '//to_text(tally%moment(3), 3)// &
        & ' N m'
      if (system%body%dim == 3) text = text//' and a moment of ('//vector(tally%moment)//') N m'
    end associate
  end function describe_left_over

  !> Components as text.
  pure function vector(values) result(text)
    real(wp), intent(in) :: values(:)
    character(:), allocatable :: text
    integer :: c

    text = to_text(values(1), 3)
    do c = 2, size(values)
      text = text//', '//to_text(values(c), 3)
    end do
  end function vector

end module pd_motion_static_balance
