!> Where a load step starts: pieces go along with supports that carry them as a whole, and pieces on
!> which nothing acts are put into their equilibrium, which is known without an iteration.
module pd_motion_static_start
  use pd_base_kinds, only: wp, i1
  use pd_base_reduce, only: add_point, new_running, running_type, total_of_running, largest_of_ranks
  use pd_base_text, only: to_text
  use pd_motion_conditions, only: impose
  use pd_motion_loads, only: other_terms
  use pd_motion_static_pieces, only: piece_text
  use pd_motion_static_rigid, only: rigid_type, fit_rigid_motion
  use pd_motion_system, only: system_type, add_loads
  implicit none (type, external)
  private
  public :: move_along, loose_text

  !> A rigid motion is taken if it leaves less than this of the distances (squared) that supports
  !> jump.
  real(wp), parameter :: worth_while = 0.25_wp
  !> Supports move as a rigid body if they miss it by no more than this part of the largest
  !> displacement.
  real(wp), parameter :: exact = 1.0e-13_wp
  integer, parameter :: most_passes = 50   !! down to the smallest numbers

contains

  !> Change the displacements of `system` from those at the end of one load step to a better start
  !> into the one that ends at time `t` [s]; forces are not renewed, and constrained components of
  !> pieces that stay are not imposed.
  !>
  !> A piece whose supports move (nearly) as a rigid body is moved on rigidly as it is deformed. A
  !> piece without load, heat and support is in equilibrium as a rigid body wherever it is: it stays
  !> in its mean place, turned as it is in the mean, without strain. With supports that move exactly
  !> as a rigid body that is where they carry it. `trend`, the change of displacement that is to be
  !> tried next (n_slots, dim, or of size 0), loses what is done here.
  subroutine move_along(system, rigid, t, trend)
    type(system_type), intent(inout) :: system  !! its displacements change
    type(rigid_type), intent(in) :: rigid       !! as `find_free_motions` found it
    real(wp), intent(in) :: t                   !! at which the load step ends [s]
    real(wp), intent(inout) :: trend(:, :)      !! (n_slots, dim), or of 0 rows [m]
    real(wp), allocatable :: imposed(:, :), rate(:, :), moved(:, :), weight(:, :), goal(:, :)
    logical, allocatable :: acted(:)
    real(wp) :: before, after
    integer :: p
    logical :: done

    call find_acted(system, rigid, t, acted)
    allocate (imposed, source=system%state%u)
    allocate (rate, source=system%state%v)
    call impose(system%motions, t, imposed, rate)
    allocate (moved, source=system%state%u)
    allocate (weight, goal, mold=imposed)
    do p = 1, rigid%pieces%number
      associate (piece => rigid%piece(p), pieces => rigid%pieces)
        associate (slots => pieces%slots(pieces%start(p):pieces%start(p + 1) - 1))
          if (size(slots) == 1 .and. .not. piece%held) cycle
          before = misfit(system, slots, imposed, system%state%u, everywhere=.true.)
          done = .false.
          if (.not. acted(p)) call put_to_rest(p, slots, done)
          if (.not. done) then
            if (.not. before > 0.0_wp) cycle
            weight(slots, :) = real(system%held(slots, :), wp)
            call fit_rigid_motion(system, rigid, p, imposed, weight, moved)
            after = misfit(system, slots, imposed, moved)
            if (.not. after < worth_while*before) then
              moved(slots, :) = system%state%u(slots, :)
              cycle
            end if
          end if
          if (size(trend) > 0) trend(slots, :) = trend(slots, :) - (moved(slots, :) &
            & - system%state%u(slots, :))
          system%state%u(slots, :) = moved(slots, :)
        end associate
      end associate
    end do

  contains

    !> Put a piece on which nothing acts where it is without strain, if its supports let it.
    subroutine put_to_rest(p, slots, done)
      integer, intent(in) :: p, slots(:)
      logical, intent(out) :: done
      real(wp) :: largest, before
      integer :: i, pass

      done = .false.
      largest = largest_of_ranks(system%body%order, max(maxval(abs(imposed(slots, :))), &
        & maxval(abs(system%state%u(slots, :)))))
      if (.not. largest > 0.0_wp) return
      goal(slots, :) = system%state%u(slots, :)
      do pass = 1, most_passes
        before = largest_of_ranks(system%body%order, maxval(abs(goal(slots, :))))
        moved(slots, :) = 0.0_wp
        do i = 1, size(slots)
          weight(slots(i), :) = system%body%volume(slots(i))
        end do
        call fit_rigid_motion(system, rigid, p, goal, weight, moved)
        if (.not. rigid%piece(p)%held) exit
        weight(slots, :) = real(system%held(slots, :), wp)
        call fit_rigid_motion(system, rigid, p, imposed, weight, moved)
        ! a motion that comes back leaves the rounding of what it was: again, from where it is
        if (.not. largest_of_ranks(system%body%order, maxval(abs(moved(slots, :)))) &
          & < before/2) exit
        goal(slots, :) = moved(slots, :)
      end do
      done = misfit(system, slots, imposed, moved) &
        & <= (exact*largest)**2*size(slots)
      if (.not. done) moved(slots, :) = system%state%u(slots, :)
    end subroutine put_to_rest
  end subroutine move_along

  !> On which pieces a load, heat or another term of the force acts at time `t`.
  subroutine find_acted(system, rigid, t, acted)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: t
    logical, allocatable, intent(out) :: acted(:)
    real(wp), allocatable :: loads(:, :)
    integer :: k

    allocate (acted(rigid%pieces%number), source=.false.)
    ! the equilibrium of a piece depends on the terms of the force
    if (other_terms(system%terms) > 0) acted = .true.
    allocate (loads(system%body%n_slots, system%body%dim), source=0.0_wp)
    call add_loads(system, t, 1.0_wp, .false., loads)
    do k = 1, system%body%n_slots
      if (rigid%pieces%of(k) == 0) cycle
      if (any(abs(loads(k, :)) > 0.0_wp)) acted(rigid%pieces%of(k)) = .true.
      if (.not. system%model%thermal) cycle
      if (abs(system%model%expansion(k)) > 0.0_wp) acted(rigid%pieces%of(k)) = .true.
    end do
    do k = 1, size(acted)
      acted(k) = largest_of_ranks(system%body%order, merge(1.0_wp, 0.0_wp, acted(k))) > 0.0_wp
    end do
  end subroutine find_acted

  !> Sum of squares of what the constrained components miss [m2], or all of them.
  real(wp) function misfit(system, slots, imposed, moved, everywhere) result(squares)
    type(system_type), intent(in) :: system
    integer, intent(in) :: slots(:)
    real(wp), intent(in) :: imposed(:, :), moved(:, :)
    logical, intent(in), optional :: everywhere
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: i, k

    call new_running(running)
    do i = 1, size(slots)
      k = slots(i)
      call add_point(system%body%order, system%body%point(k), [sum((imposed(k, :) - moved(k, :)) &
        & **2, mask=present(everywhere) .or. system%held(k, :) == 1_i1)], running)
    end do
    totals = total_of_running(system%body%order, running)
    squares = totals(1)
  end function misfit

  !> What to say about pieces that nothing holds, '' if there is nothing: `parts` was the number of
  !> pieces before bonds broke.
  function loose_text(system, rigid, parts) result(text)
    type(system_type), intent(in) :: system  !! for numbers of points
    type(rigid_type), intent(in) :: rigid    !! as `find_free_motions` found it
    integer, intent(in) :: parts             !! number of pieces before
    character(:), allocatable :: text
    integer :: p, loose, points, first

    text = ''
    if (rigid%pieces%number == parts) return
    loose = 0
    points = 0
    first = 0
    do p = 1, rigid%pieces%number
      associate (piece => rigid%piece(p), of_piece => rigid%pieces%points)
        if (piece%number == 0) cycle
        ! the largest piece of a body without supports is no piece torn off
        if (.not. any(rigid%piece%held) .and. of_piece(p) == maxval(of_piece)) cycle
        loose = loose + 1
        points = points + int(of_piece(p))
        if (first == 0) first = p
      end associate
    end do
    if (loose == 0) return
    text = to_text(points)//' points torn off in '//to_text(loose)// &
      & ' piece(s) can move freely ('// &
      & piece_text(system%body, rigid%pieces, first)
    if (loose > 1) text = text//' is the first'
    text = text//'): without a load they stay in their mean place, without strain'
  end function loose_text

end module pd_motion_static_start
