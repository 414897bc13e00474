!> Rigid motions that a body's constraints leave free. In a static problem nothing resists them, so
!> the loads must not drive them, and the answer must not contain them.
module pd_motion_rigid
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, fail
  use pd_base_numbers, only: inner
  use pd_base_text, only: to_text
  use pd_motion_system, only: system_type, add_loads
  implicit none (type, external)
  private
  public :: rigid_type, find_free_motions, check_balance, remove_free_motions

  real(wp), parameter :: balanced = 1.0e-10_wp  !! net force and moment over the applied ones
  real(wp), parameter :: held_at_all = 1.0e-12_wp

  !> The free rigid motions as combinations of three translations and three rotations.
  type :: rigid_type
    integer :: number = 0
    real(wp) :: centre(3) = 0.0_wp
    real(wp) :: size = 1.0_wp               !! of the body, which makes rotations comparable [m]
    real(wp) :: combination(6, 6) = 0.0_wp  !! columns 1..number, orthonormal in the volume
  end type rigid_type

contains

  !> Which rigid motions no constraint resists.
  subroutine find_free_motions(system, rigid)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(out) :: rigid
    real(wp) :: resistance(6, 6), vectors(6, 6), mass(6, 6), mode(6), values(6)
    integer :: k, c, i, j, dim

    dim = system%body%dim
    do c = 1, dim
      rigid%centre(c) = inner(system%body%volume, system%body%x(:, c))/sum(system%body%volume)
      rigid%size = max(rigid%size*merge(0.0_wp, 1.0_wp, c == 1), &
        & maxval(system%body%x(:, c), mask=system%body%point > 0) &
        & - minval(system%body%x(:, c), mask=system%body%point > 0))
    end do
    resistance = 0.0_wp
    mass = 0.0_wp
    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0) cycle
      do c = 1, dim
        mode = motion_at(rigid, system%body%x(k, :), c)
        do i = 1, 6
          do j = 1, 6
            mass(i, j) = mass(i, j) + mode(i)*mode(j)*system%body%volume(k)
            if (system%held(k, c) == 1) resistance(i, j) = resistance(i, j) + mode(i)*mode(j)
          end do
        end do
      end do
    end do
    call eigenvectors(resistance, values, vectors)
    do i = 1, 6
      if (values(i) > held_at_all*max(1.0_wp, maxval(values))) cycle
      ! out of the dimension (a rotation about x in a plane): no motion at all
      mode = vectors(:, i)
      do j = 1, rigid%number
        mode = mode - rigid%combination(:, j) &
          & *dot_product(rigid%combination(:, j), matmul(mass, mode))
      end do
      if (dot_product(mode, matmul(mass, mode)) <= 1.0e-10_wp*mass(1, 1)) cycle
      rigid%number = rigid%number + 1
      rigid%combination(:, rigid%number) = mode/sqrt(dot_product(mode, matmul(mass, mode)))
    end do
  end subroutine find_free_motions

  !> Component `c` of the six unit motions at position `x`.
  pure function motion_at(rigid, x, c) result(mode)
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: x(:)
    integer, intent(in) :: c
    real(wp) :: mode(6), r(3)

    r = 0.0_wp
    r(:size(x)) = (x - rigid%centre(:size(x)))/rigid%size
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

  !> An error unless the loads at time `t` leave the free motions alone.
  subroutine check_balance(system, rigid, t, error)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(in) :: t
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: loads(:, :)
    real(wp) :: work(rigid%number), applied, mode(6)
    integer :: k, c

    if (rigid%number == 0 .or. size(system%loads) == 0) return
    allocate (loads(system%body%n_slots, system%body%dim), source=0.0_wp)
    call add_loads(system, t, 1.0_wp, .false., loads)
    work = 0.0_wp
    applied = 0.0_wp
    do c = 1, system%body%dim
      do k = 1, system%body%n_slots
        if (abs(loads(k, c)) <= 0.0_wp) cycle
        mode = motion_at(rigid, system%body%x(k, :), c)
        work = work + loads(k, c)*system%body%volume(k) &
          & *matmul(mode, rigid%combination(:, :rigid%number))
        applied = applied + abs(loads(k, c))*system%body%volume(k)*maxval(abs(matmul(mode, &
          & rigid%combination(:, :rigid%number))))
      end do
    end do
    if (maxval(abs(work)) <= balanced*applied) return
    call fail(error, 'the body is free to move as a whole in '//to_text(rigid%number)// &
      & ' way(s), and the loads at t = '//to_text(t)//' push it that way (net over applied: '// &
      & to_text(maxval(abs(work))/applied)//', at most '//to_text(balanced)//' is allowed): '// &
      & 'there is no state of rest. Support it with a &boundary, or balance the loads')
  end subroutine check_balance

  !> Take the free rigid motions out of a displacement field (n_slots, dim).
  subroutine remove_free_motions(system, rigid, u)
    type(system_type), intent(in) :: system
    type(rigid_type), intent(in) :: rigid
    real(wp), intent(inout) :: u(:, :)
    real(wp) :: amount(6), mode(6)
    integer :: k, c, i

    if (rigid%number == 0) return
    amount = 0.0_wp
    do c = 1, system%body%dim
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0) cycle
        mode = motion_at(rigid, system%body%x(k, :), c)
        do i = 1, rigid%number
          amount(i) = amount(i) &
            & + dot_product(mode, rigid%combination(:, i))*u(k, c)*system%body%volume(k)
        end do
      end do
    end do
    mode = matmul(rigid%combination(:, :rigid%number), amount(:rigid%number))
    do c = 1, system%body%dim
      do k = 1, system%body%n_slots
        if (system%body%point(k) == 0 .or. system%held(k, c) == 1) cycle
        u(k, c) = u(k, c) - dot_product(motion_at(rigid, system%body%x(k, :), c), mode)
      end do
    end do
  end subroutine remove_free_motions

  !> Eigenvalues and eigenvectors of a small symmetric matrix by Jacobi's rotations.
  pure subroutine eigenvectors(matrix, values, vectors)
    real(wp), intent(in) :: matrix(6, 6)
    real(wp), intent(out) :: values(6), vectors(6, 6)
    real(wp) :: a(6, 6), rotation(6, 6), angle
    integer :: sweep, i, j

    a = matrix
    vectors = 0.0_wp
    do i = 1, 6
      vectors(i, i) = 1.0_wp
    end do
    do sweep = 1, 30
      do i = 1, 5
        do j = i + 1, 6
          if (abs(a(i, j)) <= 0.0_wp) cycle
          angle = 0.5_wp*atan2(2*a(i, j), a(j, j) - a(i, i))
          rotation = 0.0_wp
          rotation(1, 1) = 1.0_wp; rotation(2, 2) = 1.0_wp; rotation(3, 3) = 1.0_wp
          rotation(4, 4) = 1.0_wp; rotation(5, 5) = 1.0_wp; rotation(6, 6) = 1.0_wp
          rotation(i, i) = cos(angle); rotation(j, j) = cos(angle)
          rotation(i, j) = sin(angle); rotation(j, i) = -sin(angle)
          a = matmul(transpose(rotation), matmul(a, rotation))
          a(i, j) = 0.0_wp; a(j, i) = 0.0_wp
          vectors = matmul(vectors, rotation)
        end do
      end do
    end do
    do i = 1, 6
      values(i) = a(i, i)
    end do
  end subroutine eigenvectors

end module pd_motion_rigid
