!> Rigid motions of the pieces of a body, and which of them the constraints leave free. In a static
!> problem nothing resists those, so the loads must not drive them.
module pd_motion_static_rigid
  use pd_base_eigen, only: eigenvectors, solve_symmetric
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_base_reduce, only: add_point, count_of_ranks, new_running, running_type, &
    & total_of_running, largest_of_ranks, largest_over
  use pd_base_error, only: error_type, fail
  use pd_base_text, only: to_text
  use pd_base_vectors, only: cross
  use pd_body_body, only: owned
  use pd_motion_static_pieces, only: pieces_type, find_pieces, piece_text
  use pd_force_term, only: term_view_type
  use pd_motion_conditions, only: free_component
  use pd_motion_pins, only: held_but_for_pins
  use pd_motion_loads, only: load_of, load_type, number_of_loads, other_terms
  use pd_motion_system, only: system_type, add_loads, view_of
  implicit none (type, external)
  private
  public :: rigid_type, piece_type, find_free_motions, check_balance, remove_free_motions
  public :: turn_back, fit_rigid_motion, motion_at

  real(wp), parameter :: balanced = 1.0e-10_wp  !! net force and moment over the applied ones
  real(wp), parameter :: held_at_all = 1.0e-12_wp
  integer, parameter :: most_turns = 60         !! iterations to find a finite rotation
  real(wp), parameter :: negligible = 1.0e-14_wp !! motion over the displacements
  !> So many turns that bring neither the goal nearer nor an end: what is to be fitted does not look
  !> like a rigid motion, or only rounding is left.
  integer, parameter :: most_vain_turns = 3
  real(wp), parameter :: no_nearer = 1 - 1.0e-6_wp, no_smaller = 0.5_wp

  !> A piece, and its free rigid motions as combinations of three translations and three rotations.
  type :: piece_type
    integer :: number = 0
    real(wp) :: centre(3) = 0.0_wp          !! of its volume [m]
    real(wp) :: size = 1.0_wp               !! its extent, which makes rotations comparable [m]
    real(wp) :: combination(6, 6) = 0.0_wp  !! columns 1..number, orthonormal in the volume
    logical :: held = .false.               !! some component is constrained
    logical :: loaded = .false.             !! a load acts on it, at whatever time
  end type piece_type

  !> All pieces of a body.
  type :: rigid_type
    type(pieces_type) :: pieces
    type(piece_type), allocatable :: piece(:)
    integer, allocatable :: first_of_pin(:)  !! (motions) the first and the last piece in which the
    integer, allocatable :: last_of_pin(:)   !! points of a pin are; 0 for other boundaries
  end type rigid_type

contains

  !> The pieces that intact bonds join now, and which rigid motions of each neither a constraint
  !> nor a term of the force resists, while the other pieces stay where they are.
  subroutine find_free_motions(system, rigid)
    type(system_type), intent(in), target :: system  !! with its bonds as they are now
    type(rigid_type), intent(out) :: rigid           !! pieces and free motions
    type(load_type), pointer :: load
    real(wp), allocatable :: resistance(:, :, :)
    integer(i1), allocatable :: held(:, :)
    integer :: p, l, i

    call find_pieces(system%body, system%family, rigid%pieces)
    allocate (rigid%piece(rigid%pieces%number))
    do p = 1, rigid%pieces%number
      associate (pieces => rigid%pieces)
        call place_piece(system, pieces%slots(pieces%start(p):pieces%start(p + 1) - 1), &
          & rigid%piece(p))
      end associate
    end do
    call place_pins(system, rigid)
    call find_resistance(system, rigid, resistance)
    call resist_by_pins(system, rigid, resistance)
    held = held_but_for_pins(system)
    do p = 1, rigid%pieces%number
      associate (pieces => rigid%pieces)
        call describe_piece(system, held, pieces%slots(pieces%start(p):pieces%start(p + 1) - 1), &
          & resistance(:, :, p), rigid%piece(p))
      end associate
    end do
    ! other external terms may act anywhere
    if (system%terms%outside > number_of_loads(system%terms)) rigid%piece%loaded = .true.
    do l = 1, number_of_loads(system%terms)
      load => load_of(system%terms, l)
      do i = 1, size(load%slots)
        if (any(abs(load%density(i, :)) > 0.0_wp)) &
          & rigid%piece(rigid%pieces%of(load%slots(i)))%loaded = .true.
      end do
    end do
    do p = 1, rigid%pieces%number
      rigid%piece(p)%loaded = largest_of_ranks(system%body%order, &
        & merge(1.0_wp, 0.0_wp, rigid%piece(p)%loaded)) > 0.0_wp
    end do
  end subroutine find_free_motions

  !> Place and extent of the piece that consists of `slots`.
  subroutine place_piece(system, slots, piece)
    type(system_type), intent(in) :: system
    integer, intent(in) :: slots(:)
    type(piece_type), intent(out) :: piece
    integer :: c, dim

    dim = system%body%dim
    piece%centre(:dim) = mean_over(system, slots, system%body%x)
    associate (order => system%body%order)
      piece%size = largest_of_ranks(order, maxval(system%body%spacing(slots)))
      do c = 1, dim
        piece%size = max(piece%size, largest_of_ranks(order, maxval(system%body%x(slots, c))) &
          & + largest_of_ranks(order, -minval(system%body%x(slots, c))))
      end do
      piece%held = largest_of_ranks(order, &
        & real(maxval(system%held(slots, :)), wp)) > 0.0_wp
    end associate
  end subroutine place_piece

  !> The pieces in which pins are; a rank may have no point of a pin.
  subroutine place_pins(system, rigid)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(inout) :: rigid  !! with its pieces
    integer :: m

    allocate (rigid%first_of_pin(size(system%motions)), rigid%last_of_pin(size(system%motions)), &
      & source=0)
    do m = 1, size(system%motions)
      if (.not. system%motions(m)%is_pin) cycle
      associate (of => rigid%pieces%of(system%motions(m)%slots), order => system%body%order)
        rigid%first_of_pin(m) = -nint(largest_of_ranks(order, -real(minval(of), wp)))
        rigid%last_of_pin(m) = nint(largest_of_ranks(order, real(max(0_i4, maxval(of)), wp)))
      end associate
    end do
  end subroutine place_pins

  !> What the terms of the force resist to the six unit motions of each piece alone, over the
  !> largest stiffness of a point, so that a point counts about as one that is held.
  subroutine find_resistance(system, rigid, resistance)
    type(system_type), intent(in), target :: system
    type(rigid_type), intent(in) :: rigid              !! pieces in their places
    real(wp), allocatable, intent(out) :: resistance(:, :, :)  !! (6, 6, pieces) [-]
    real(wp), allocatable :: w(:, :), kw(:, :), rows(:)
    type(term_view_type) :: view
    type(running_type) :: running
    real(wp) :: mode(6), largest
    integer :: i, n, k, c, p

    allocate (resistance(6, 6, rigid%pieces%number), source=0.0_wp)
    if (other_terms(system%terms) == 0) return
    call view_of(system, system%time, view)
    allocate (rows(system%body%n_slots), source=0.0_wp)
    call system%terms%add_stiffness_bound(view, rows)
    rows = rows*system%body%volume
    largest = largest_over(system%body%order, rows)
    if (.not. largest > 0.0_wp) return
    allocate (w, kw, mold=system%state%u)
    w = 0.0_wp
    do p = 1, rigid%pieces%number
      associate (piece => rigid%piece(p), slots => rigid%pieces%slots(rigid%pieces%start(p): &
        & rigid%pieces%start(p + 1) - 1))
        do i = 1, 6
          do c = 1, system%body%dim
            do n = 1, size(slots)
              mode = motion_at(piece%centre, piece%size, system%body%x(slots(n), :), c)
              w(slots(n), c) = mode(i)
            end do
          end do
          kw = 0.0_wp
          call system%terms%add_tangent(view, w, kw)
          call new_running(running)
          do n = 1, size(slots)
            k = slots(n)
            do c = 1, system%body%dim
              mode = motion_at(piece%centre, piece%size, system%body%x(k, :), c)
              call add_point(system%body%order, system%body%point(k), &
                & mode*(kw(k, c)*system%body%volume(k)/largest), running)
            end do
          end do
          resistance(:, i, p) = total_of_running(system%body%order, running)
        end do
        w(slots, :) = 0.0_wp
      end associate
    end do
  end subroutine find_resistance

  !> Add what pins resist: the imposed components of their centres, so that a point of a pin counts
  !> as one that is held.
  subroutine resist_by_pins(system, rigid, resistance)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid               !! pieces in their places
    real(wp), intent(inout) :: resistance(:, :, :)      !! (6, 6, pieces) [-] added to
    real(wp) :: mode(6)
    integer :: m, c, i, p
    integer(i8) :: points

    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        if (.not. motion%is_pin) cycle
        p = rigid%first_of_pin(m)
        points = count_of_ranks(system%body%order, count(owned(system%body, int(motion%slots)), &
          & kind=i8))
        do c = 1, system%body%dim
          if (motion%kind(c) == free_component) cycle
          mode = motion_at(rigid%piece(p)%centre, rigid%piece(p)%size, &
            & motion%pose%centre(:system%body%dim), c)
          do i = 1, 6
            resistance(:, i, p) = resistance(:, i, p) + points*mode(i)*mode
          end do
        end do
      end associate
    end do
  end subroutine resist_by_pins

  !> Free motions of the piece that consists of `slots`.
  subroutine describe_piece(system, held_to, slots, of_terms, piece)
    type(system_type), intent(in) :: system
    integer(i1), intent(in) :: held_to(:, :)    !! (n_slots, dim) 1 where constrained, but for pins
    integer, intent(in) :: slots(:)
    real(wp), intent(in) :: of_terms(6, 6)      !! resistance of terms of the force and of pins [-]
    type(piece_type), intent(inout) :: piece    !! in its place
    type(running_type) :: of_mass(6), of_resistance(6)
    real(wp) :: resistance(6, 6), vectors(6, 6), mass(6, 6), mode(6), values(6), held(6)
    integer :: n, k, c, i, j, dim

    dim = system%body%dim
    associate (order => system%body%order)
      do i = 1, 6
        call new_running(of_mass(i))
        call new_running(of_resistance(i))
      end do
      do n = 1, size(slots)
        k = slots(n)
        do c = 1, dim
          mode = motion_at(piece%centre, piece%size, system%body%x(k, :), c)
          do i = 1, 6
            if (abs(mode(i)) <= 0.0_wp) cycle
            held = mode(i)*mode
            call add_point(order, system%body%point(k), held*system%body%volume(k), of_mass(i))
            if (held_to(k, c) == 1_i1) &
              & call add_point(order, system%body%point(k), held, of_resistance(i))
          end do
        end do
      end do
      do i = 1, 6
        mass(:, i) = total_of_running(order, of_mass(i))
        resistance(:, i) = of_terms(:, i) + total_of_running(order, of_resistance(i))
      end do
    end associate
    call eigenvectors(resistance, values, vectors)
    do i = 1, 6
      if (values(i) > held_at_all*max(1.0_wp, maxval(values))) cycle
      ! out of the dimension (a rotation about x in a plane): no motion at all
      mode = vectors(:, i)
      do j = 1, piece%number
        mode = mode - piece%combination(:, j) &
          & *dot_product(piece%combination(:, j), matmul(mass, mode))
      end do
      if (dot_product(mode, matmul(mass, mode)) <= 1.0e-10_wp*mass(1, 1)) cycle
      piece%number = piece%number + 1
      piece%combination(:, piece%number) = mode/sqrt(dot_product(mode, matmul(mass, mode)))
    end do
  end subroutine describe_piece

  !> The mean of a field (n_slots, dim) over a piece, weighted with volume.
  function mean_over(system, slots, field) result(mean)
    type(system_type), intent(in) :: system
    integer, intent(in) :: slots(:)            !! of the piece, in the order of points
    real(wp), intent(in) :: field(:, :)
    real(wp) :: mean(size(field, 2))
    type(running_type) :: running
    real(wp) :: totals(6)
    integer :: n, k

    call new_running(running)
    do n = 1, size(slots)
      k = slots(n)
      call add_point(system%body%order, system%body%point(k), &
        & [system%body%volume(k)*field(k, :), system%body%volume(k)], running)
    end do
    totals = total_of_running(system%body%order, running)
    mean = totals(:size(mean))/totals(size(mean) + 1)
  end function mean_over

  !> Component `c` of the six unit motions at position `x`.
  pure function motion_at(centre, size_of, x, c) result(mode)
    real(wp), intent(in) :: centre(3), size_of
    real(wp), intent(in) :: x(:)
    integer, intent(in) :: c
    real(wp) :: mode(6), r(3)

    r = 0.0_wp
    r(:size(x)) = (x - centre(:size(x)))/size_of
    mode = 0.0_wp
    mode(c) = 1.0_wp
    if (size(x) == 1) return
    ! rotations about z, and in 3D about x and y
    select case (c)
    case (1)
      mode(4) = -r(2)
      if (size(x) == 3) mode(6) = r(3)
    case (2)
      mode(4) = r(1)
      if (size(x) == 3) mode(5) = -r(3)
    case default
      mode(5) = r(2)
      mode(6) = -r(1)
    end select
  end function motion_at

  !> An error unless the loads at time `t` leave the free motions of every piece alone. `status` is
  !> that of the error.
  subroutine check_balance(system, rigid, t, status, error)
    type(system_type), intent(in) :: system  !! its loads
    type(rigid_type), intent(in) :: rigid    !! as `find_free_motions` found it
    real(wp), intent(in) :: t                !! time of the loads [s]
    integer, intent(in) :: status            !! exit status of the error
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: loads(:, :)
    type(running_type) :: of_work, of_applied
    real(wp) :: work(6), applied, mode(6), share(6), totals(6)
    integer :: p, i, k, c

    if (system%terms%outside == 0 .or. all(rigid%piece%number == 0)) return
    allocate (loads(system%body%n_slots, system%body%dim), source=0.0_wp)
    call add_loads(system, t, 1.0_wp, .false., loads)
    do p = 1, rigid%pieces%number
      associate (piece => rigid%piece(p), pieces => rigid%pieces)
        if (piece%number == 0 .or. .not. piece%loaded) cycle
        call new_running(of_work)
        call new_running(of_applied)
        do i = pieces%start(p), pieces%start(p + 1) - 1
          k = pieces%slots(i)
          do c = 1, system%body%dim
            if (abs(loads(k, c)) <= 0.0_wp) cycle
            mode = motion_at(piece%centre, piece%size, system%body%x(k, :), c)
            share = matmul(mode, piece%combination)
            call add_point(system%body%order, system%body%point(k), &
              & loads(k, c)*system%body%volume(k)*share, of_work)
            call add_point(system%body%order, system%body%point(k), &
              & [abs(loads(k, c))*system%body%volume(k)*maxval(abs(share))], of_applied)
          end do
        end do
        work = total_of_running(system%body%order, of_work)
        totals = total_of_running(system%body%order, of_applied)
        applied = totals(1)
        if (maxval(abs(work)) <= balanced*applied) cycle
        call fail(error, piece_text(system%body, pieces, p)//' is free to move as a whole in '// &
          & to_text(piece%number)//' way(s), and the loads at t = '//to_text(t)// &
          & ' push it that way ('//driving_text(system%body%dim, piece, work)// &
          & ', net over applied '// &
          & to_text(maxval(abs(work))/applied, 3)//', at most '//to_text(balanced)// &
          & ' is allowed): there is no static equilibrium. Support it with a &boundary, or '// &
          & 'balance the loads', status)
        return
      end associate
    end do
  end subroutine check_balance

  !> The force and moment by which loads drive the free motions of a piece, in words: the force
  !> along its free translations, and the moment about the point, or axis, about which it can turn.
  function driving_text(dim, piece, work) result(text)
    integer, intent(in) :: dim
    type(piece_type), intent(in) :: piece
    real(wp), intent(in) :: work(6)   !! of the loads on each free motion
    character(:), allocatable :: text
    real(wp) :: rotations(6, 6), values(6), vectors(6, 6), mode(6), turning(6), force(3), axis(3), &
      & place(3)
    integer :: i, j, n, translations, turns

    ! free motions without rotation are the null space of what rotates in all of them
    n = piece%number
    rotations = 0.0_wp
    do i = 1, 6
      rotations(i, i) = -1.0_wp
    end do
    rotations(:n, :n) = matmul(transpose(piece%combination(4:, :n)), piece%combination(4:, :n)) &
      & /maxval(sum(piece%combination(:, :n)**2, dim=1))
    call eigenvectors(rotations, values, vectors)
    force = 0.0_wp
    turning = 0.0_wp
    translations = 0
    turns = 0
    do i = 1, 6
      if (values(i) < -0.5_wp) cycle
      mode = matmul(piece%combination(:, :n), vectors(:n, i))
      if (values(i) <= held_at_all) then
        translations = translations + 1
        force = force + mode(:3)*(dot_product(work(:n), vectors(:n, i))/sum(mode(:3)**2))
      else
        turns = turns + 1
        turning = turning + mode*dot_product(work(:n), vectors(:n, i))
      end if
    end do
    text = ''
    if (translations > 0) text = 'net force '//to_text(norm2(force), 3)//' N'
    if (translations > 0 .and. translations < dim .and. norm2(force) > 0.0_wp) &
      & text = text//' along '//vector_text(force/norm2(force))
    if (turns == 0) return
    if (translations > 0) text = text//', '
    axis = [turning(5), turning(6), turning(4)]/piece%size
    if (.not. norm2(axis) > 0.0_wp) then
      text = text//'no moment'
      return
    end if
    place = piece%centre + cross(axis, turning(:3))/sum(axis**2)
    text = text//'net moment '//to_text(sum([(dot_product(work(:n), vectors(:n, j))**2, j=1, 6)], &
      & mask=values > held_at_all)/norm2(axis), 3)//' N m about '
    if (turns == 3 .and. translations == 3) then
      text = text//'its centre '//vector_text(piece%centre)
    else if (dim == 2) then
      text = text//vector_text(place)
    else
      text = text//'the axis through '//vector_text(place)//' along '// &
        & vector_text(axis/norm2(axis))
    end if

  contains

    !> The components of a vector between brackets; those that are rounding are 0.
    function vector_text(vector) result(words)
      real(wp), intent(in) :: vector(3)
      character(:), allocatable :: words
      integer :: c

      words = '('
      do c = 1, dim
        if (c > 1) words = words//', '
        words = words//to_text(merge(vector(c), 0.0_wp, abs(vector(c)) &
          & > 1.0e-9_wp*max(norm2(vector), tiny(1.0_wp))), 3)
      end do
      words = words//')'
    end function vector_text
  end function driving_text

  !> Take the free rigid motions of every piece out of a field (n_slots, dim), by linear modes about
  !> the undeformed body.
  subroutine remove_free_motions(system, rigid, field)
    type(system_type), intent(in) :: system  !! its positions, volumes and constrained components
    type(rigid_type), intent(in) :: rigid    !! as `find_free_motions` found it
    real(wp), intent(inout) :: field(:, :)
      !! (n_slots, dim) constrained components stay as they are
    real(wp) :: mode(6)
    integer :: p, i, k, c

    do p = 1, rigid%pieces%number
      associate (piece => rigid%piece(p), pieces => rigid%pieces)
        if (piece%number == 0) cycle
        mode = matmul(piece%combination, amounts(system, piece, &
          & pieces%slots(pieces%start(p):pieces%start(p + 1) - 1), field))
        do c = 1, system%body%dim
          do i = pieces%start(p), pieces%start(p + 1) - 1
            k = pieces%slots(i)
            if (system%held(k, c) == 1_i1) cycle
            field(k, c) = field(k, c) &
              & - dot_product(motion_at(piece%centre, piece%size, system%body%x(k, :), c), mode)
          end do
        end do
      end associate
    end do
  end subroutine remove_free_motions

  !> How much of each free motion of a piece is in a field.
  function amounts(system, piece, slots, field) result(amount)
    type(system_type), intent(in) :: system
    type(piece_type), intent(in) :: piece
    integer, intent(in) :: slots(:)
    real(wp), intent(in) :: field(:, :)
    real(wp) :: amount(6), mode(6)
    type(running_type) :: running
    integer :: n, k, c

    call new_running(running)
    do n = 1, size(slots)
      k = slots(n)
      mode = 0.0_wp
      do c = 1, system%body%dim
        mode = mode + motion_at(piece%centre, piece%size, system%body%x(k, :), c)*field(k, c)
      end do
      call add_point(system%body%order, system%body%point(k), mode*system%body%volume(k), running)
    end do
    mode = total_of_running(system%body%order, running)
    amount = matmul(mode, piece%combination)
  end function amounts

  !> Take the mean motion out of displacements `u` (n_slots, dim) [m] where nothing holds it,
  !> without straining anything: a piece without any constraint is moved and turned back as a rigid
  !> body until its mean displacement and mean rotation vanish (the best fit to where its points
  !> were in the least squares of volume). Of a piece that is held in part, and of all pieces
  !> without `turning`, a free translation is taken back, and a free rotation left as it is.
  subroutine turn_back(system, rigid, turning, u)
    type(system_type), intent(in) :: system  !! its positions, volumes and constrained components
    type(rigid_type), intent(in) :: rigid    !! as `find_free_motions` found it
    logical, intent(in) :: turning           !! pieces without any constraint are turned back
    real(wp), intent(inout) :: u(:, :)       !! (n_slots, dim) displacements [m]
    real(wp) :: mode(6), amount(6), largest
    integer :: p, turn, i, c

    do p = 1, rigid%pieces%number
      associate (piece => rigid%piece(p), pieces => rigid%pieces)
        if (piece%number == 0) cycle
        associate (slots => pieces%slots(pieces%start(p):pieces%start(p + 1) - 1))
          if (piece%held .or. .not. turning) then
            ! about the centre of volume, translations and rotations don't mix in the modes
            amount = amounts(system, piece, slots, u)
            do i = 1, piece%number
              if (any(abs(piece%combination(4:, i)) > 1.0e-9_wp*norm2(piece%combination(:3, i)))) &
                & cycle
              do c = 1, system%body%dim
                where (system%held(slots, c) == 0_i1) &
                  & u(slots, c) = u(slots, c) - amount(i)*piece%combination(c, i)
              end do
            end do
            cycle
          end if
          largest = largest_of_ranks(system%body%order, maxval(abs(u(slots, :))))
          do turn = 1, most_turns
            mode = matmul(piece%combination, amounts(system, piece, slots, u))
            call move_rigidly(system, piece, slots, -mode, u)
            if (all(abs(mode) <= negligible*largest)) exit
          end do
        end associate
      end associate
    end do
  end subroutine turn_back

  !> Move the points `slots` as a rigid body on from where `u` has put them: translations mode(1:3)
  !> [m] and rotations mode(4:6)/size [rad] about z, x and y through the centre as it has moved. The
  !> increments are formed without differences of large numbers, so that small motions keep their
  !> digits.
  subroutine move_rigidly(system, piece, slots, mode, u)
    type(system_type), intent(in) :: system
    type(piece_type), intent(in) :: piece
    integer, intent(in) :: slots(:)
    real(wp), intent(in) :: mode(6)
    real(wp), intent(inout) :: u(:, :)
    real(wp) :: axis(3), angle, r(3), centre(3), turned(3), across(3)
    integer :: n, k, dim

    dim = system%body%dim
    centre = piece%centre
    centre(:dim) = centre(:dim) + mean_over(system, slots, u)
    axis = [mode(5), mode(6), mode(4)]/piece%size
    angle = norm2(axis)
    if (angle > 0.0_wp) axis = axis/angle
    do n = 1, size(slots)
      k = slots(n)
      r = 0.0_wp
      r(:dim) = system%body%x(k, :) + u(k, :) - centre(:dim)
      across = cross(axis, r)
      ! Rodrigues: (R - 1) r
      turned = sin(angle)*across + 2*sin(angle/2)**2*cross(axis, across)
      u(k, :) = u(k, :) + mode(:dim) + turned(:dim)
    end do
  end subroutine move_rigidly

  !> Move a piece as a rigid body on from displacements `u` so that it comes as near as it can to
  !> `target` (n_slots, dim) [m] in the least squares of `weight` (n_slots, dim), by Newton's
  !> iterations on the finite motion, to the last digit of what is left of the displacements.
  !> Motions that no weighted component sees are left alone.
  subroutine fit_rigid_motion(system, rigid, p, target, weight, u)
    type(system_type), intent(in) :: system  !! its positions and volumes
    type(rigid_type), intent(in) :: rigid    !! its pieces
    integer, intent(in) :: p                 !! number of the piece
    real(wp), intent(in) :: target(:, :)     !! (n_slots, dim) displacements to come near to [m]
    real(wp), intent(in) :: weight(:, :)
      !! (n_slots, dim) of each component, 0 for those that do not count
    real(wp), intent(inout) :: u(:, :)
      !! (n_slots, dim) displacements; those of the piece change [m]
    real(wp) :: matrix(6, 6), side(6), mode(6), part(6), centre(3), size_now, size_before, &
      & misfit, least
    type(running_type) :: of_matrix(6), of_side, of_misfit
    integer :: turn, n, k, c, i, vain

    associate (piece => rigid%piece(p), pieces => rigid%pieces)
      associate (slots => pieces%slots(pieces%start(p):pieces%start(p + 1) - 1))
        size_before = huge(size_before)
        least = huge(least)
        vain = 0
        do turn = 1, most_turns
          centre = piece%centre
          centre(:system%body%dim) = centre(:system%body%dim) + mean_over(system, slots, u)
          call new_running(of_side)
          call new_running(of_misfit)
          do i = 1, 6
            call new_running(of_matrix(i))
          end do
          do n = 1, size(slots)
            k = slots(n)
            do c = 1, system%body%dim
              if (.not. weight(k, c) > 0.0_wp) cycle
              part = motion_at(centre, piece%size, system%body%x(k, :) + u(k, :), c)
              call add_point(system%body%order, system%body%point(k), &
                & [weight(k, c)*(target(k, c) - u(k, c))**2], of_misfit)
              call add_point(system%body%order, system%body%point(k), &
                & weight(k, c)*(target(k, c) - u(k, c))*part, of_side)
              do i = 1, 6
                if (abs(part(i)) > 0.0_wp) call add_point(system%body%order, &
                  & system%body%point(k), weight(k, c)*part(i)*part, of_matrix(i))
              end do
            end do
          end do
          side = total_of_running(system%body%order, of_side)
          do i = 1, 6
            matrix(:, i) = total_of_running(system%body%order, of_matrix(i))
          end do
          mode = solve_symmetric(matrix, side)
          ! at most a radian at a time
          mode = mode/max(1.0_wp, norm2(mode(4:))/piece%size)
          call move_rigidly(system, piece, slots, mode, u)
          size_now = norm2(mode)
          if (size_now <= negligible*largest_of_ranks(system%body%order, &
            & maxval(abs(u(slots, :))))) exit
          part = total_of_running(system%body%order, of_misfit)
          misfit = part(1)
          if (size_now > no_smaller*size_before .and. misfit >= no_nearer*least) vain = vain + 1
          if (vain == most_vain_turns) exit
          size_before = size_now
          least = min(least, misfit)
        end do
      end associate
    end associate
  end subroutine fit_rigid_motion

end module pd_motion_static_rigid
