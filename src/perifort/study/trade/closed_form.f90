!> Solutions in closed form (doc/theory.md, 12): the value of a field at a point and a time.
!>
!> A form is plain numbers; `pd_study_trade_analytic` takes them from a scene.
module pd_study_trade_closed_form
  use pd_base_kinds, only: wp
  use pd_base_error, only: internal_fault
  use pd_output_fields_exact, only: exact_type
  use pd_output_fields_field, only: output_field_type
  implicit none (type, external)
  private
  public :: closed_form_type, field_at, form_wave, form_linear, form_hole, form_chain, &
    & chain_frequency

  integer, parameter :: form_wave = 1    !! a bar released from uniform strain
  integer, parameter :: form_linear = 2  !! displacements linear in x, static
  integer, parameter :: form_hole = 3    !! a hole in an infinite plate
  integer, parameter :: form_chain = 4   !! one wave number on a chain of points

  type :: closed_form_type
    integer :: kind = 0
    integer :: dim = 1
    character(:), allocatable :: name
    real(wp) :: modulus = 0.0_wp         !! E; plane strain: E/(1 - nu2) [Pa]
    real(wp) :: ratio = 0.0_wp           !! nu; plane strain: nu/(1 - nu)
    real(wp) :: across = 0.0_wp          !! stress zz over xx + yy, nu in plane strain, else 0
    ! form_linear: u = gradient (x - origin) + shift
    real(wp) :: gradient(3, 3) = 0.0_wp  !! [-]
    real(wp) :: origin(3) = 0.0_wp       !! of form_wave the held end, of form_hole the centre [m]
    real(wp) :: shift(3) = 0.0_wp        !! [m]
    ! form_wave: held at origin, free at a distance of `length` in the direction of `side`
    real(wp) :: length = 0.0_wp          !! [m]
    real(wp) :: side = 1.0_wp
    real(wp) :: speed = 0.0_wp           !! sqrt(E/rho) [m/s]
    ! form_hole: `stress` along direction `axis`, far away
    real(wp) :: radius = 0.0_wp          !! [m]
    real(wp) :: stress = 0.0_wp          !! [Pa]
    integer :: axis = 1
    ! form_chain
    real(wp) :: spacing = 0.0_wp         !! [m]
    real(wp) :: frequency = 0.0_wp       !! omega [1/s]
    real(wp), allocatable :: u(:), v(:)  !! at t = 0, point by point [m], [m/s]
    real(wp) :: lower = -huge(1.0_wp)    !! it holds from here [m]
    real(wp) :: upper = huge(1.0_wp)     !! to here [m]
  end type closed_form_type

contains

  !> The field at `x` (dim) [m] and time `t` [s]; `known` is false where the form says nothing of
  !> it.
  pure subroutine field_at(form, field, x, t, values, known)
    type(closed_form_type), intent(in) :: form    !! completed for the scene
    type(output_field_type), intent(in) :: field  !! which field of the output
    real(wp), intent(in) :: x(:)                  !! (dim) position [m]
    real(wp), intent(in) :: t  !! time, for the forms that move [s]
    real(wp), intent(out) :: values(:)  !! (components)
    logical, intent(out) :: known                 !! `values` are set to the closed form's answer
    type(exact_type) :: state

    state%dim = form%dim
    if (all(x >= form%lower) .and. all(x <= form%upper)) then
      select case (form%kind)
      case (form_wave)
        call wave(form, x(1), t, state)
      case (form_hole)
        call hole(form, x, state)
      case (form_chain)
        call chain(form, x(1), t, state)
      case (form_linear)
        call linear(form, x, state)
      case default
        call internal_fault('field_at does not know a closed form')
      end select
    end if
    call field%exact_values(state, values, known)
  end subroutine field_at

  !> d'Alembert: half of the start runs to each side; it is continued odd about the held end and
  !> even about the free one, with a period of four lengths.
  pure subroutine wave(form, x, t, state)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(in) :: x, t
    type(exact_type), intent(inout) :: state
    real(wp) :: s, run, strain

    state%known = .true.
    state%knows_velocity = .true.
    state%knows_strain = .true.
    s = form%side*(x - form%origin(1))
    run = form%speed*t
    strain = form%gradient(1, 1)*(slope(s - run) + slope(s + run))/2
    state%displacement(1) = form%side*form%gradient(1, 1)*(start(s - run) + start(s + run))/2
    state%velocity(1) = form%side*form%gradient(1, 1)*form%speed*(slope(s + run) - slope(s - run))/2
    state%dilatation = strain
    state%energy_density = form%modulus*strain**2/2
    state%knows_stress = .true.
    state%gradient(1, 1) = strain
    state%stress(1, 1) = form%modulus*strain

  contains

    pure real(wp) function start(s)
      real(wp), intent(in) :: s
      start = modulo(s + form%length, 4*form%length)
      if (start <= 2*form%length) then
        start = start - form%length
      else
        start = 3*form%length - start
      end if
    end function start

    pure real(wp) function slope(s)
      real(wp), intent(in) :: s
      slope = merge(1.0_wp, -1.0_wp, modulo(s + form%length, 4*form%length) <= 2*form%length)
    end function slope
  end subroutine wave

  !> u = H (x - origin) + shift, static, without damage and in equilibrium.
  pure subroutine linear(form, x, state)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(in) :: x(:)
    type(exact_type), intent(inout) :: state
    real(wp) :: strain(3, 3)
    integer :: d, c

    d = form%dim
    strain = (form%gradient + transpose(form%gradient))/2
    call rest(state)
    state%displacement(:d) = form%shift(:d) + matmul(form%gradient(:d, :d), x - form%origin(:d))
    state%dilatation = sum([(strain(c, c), c=1, d)])
    state%energy_density = energy_of(form, strain(:d, :d), state%dilatation)
    state%knows_stress = .true.
    state%gradient(:d, :d) = form%gradient(:d, :d)
    state%stress(:d, :d) = form%modulus/(1 + form%ratio)*strain(:d, :d)
    do c = 1, d
      state%stress(c, c) = state%stress(c, c) + lame_of(form)*state%dilatation
    end do
    if (d == 2) state%stress(3, 3) = form%across*(state%stress(1, 1) + state%stress(2, 2))
  end subroutine linear

  !> All is known of a state of equilibrium, and the velocity is 0.
  pure subroutine rest(state)
    type(exact_type), intent(inout) :: state
    state%known = .true.
    state%knows_velocity = .true.
    state%knows_strain = .true.
    state%in_equilibrium = .true.
  end subroutine rest

  !> Energy density of a strain [J/m3]: mu e:e + lambda tr(e)^2/2, lambda that of the dimension.
  pure real(wp) function energy_of(form, strain, trace) result(energy)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(in) :: strain(:, :)
    real(wp), intent(in) :: trace

    energy = form%modulus/(2*(1 + form%ratio))*sum(strain**2) + lame_of(form)*trace**2/2
  end function energy_of

  !> lambda of the dimension [Pa]: stress = 2 mu strain + lambda tr(strain). In 1D, where the ratio
  !> is 0, nothing is left for it.
  pure real(wp) function lame_of(form) result(lame)
    type(closed_form_type), intent(in) :: form

    associate (e => form%modulus, nu => form%ratio)
      select case (form%dim)
      case (3)
        lame = e*nu/((1 + nu)*(1 - 2*nu))
      case (2)
        lame = e*nu/(1 - nu**2)
      case (1)
        lame = 0.0_wp
      case default
        lame = 0.0_wp
        call internal_fault('lame_of knows one to three dimensions')
      end select
    end associate
  end function lame_of

  !> The solution of Kirsch: a hole in an infinite plate under uniaxial stress S, by Kolosov's
  !> potentials
  !> phi = S/4 (z + 2 a^2/z), psi = -S/2 (z + a^2/z - a^4/z^3) with z = x + i y, x along the load:
  !> 2 mu (u + i v) = kappa phi - z conj(phi') - conj(psi); kappa = (3 - nu)/(1 + nu) holds for both
  !> planes with the moduli of the plane.
  pure subroutine hole(form, x, state)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(in) :: x(:)
    type(exact_type), intent(inout) :: state
    complex(wp) :: z, phi, phi1, phi2, psi, psi1, u, shear_part
    real(wp) :: mu, kappa, along, across, mean, half_difference, turn
    integer :: other

    other = 3 - form%axis
    z = cmplx(x(form%axis) - form%origin(form%axis), x(other) - form%origin(other), wp)
    if (abs(z) < form%radius*(1 - 1.0e-9_wp)) return
    call rest(state)
    mu = form%modulus/(2*(1 + form%ratio))
    kappa = (3 - form%ratio)/(1 + form%ratio)
    associate (s => form%stress, a => form%radius)
      phi = s/4*(z + 2*a**2/z)
      phi1 = s/4*(1 - 2*a**2/z**2)
      phi2 = s*a**2/z**3
      psi = -s/2*(z + a**2/z - a**4/z**3)
      psi1 = -s/2*(1 - a**2/z**2 + 3*a**4/z**4)
    end associate
    u = (kappa*phi - z*conjg(phi1) - conjg(psi))/(2*mu)
    state%displacement(form%axis) = real(u, wp)
    state%displacement(other) = aimag(u)
    state%dilatation = (kappa - 1)/mu*real(phi1, wp)
    mean = 2*real(phi1, wp)
    shear_part = conjg(z)*phi2 + psi1
    half_difference = real(shear_part, wp)
    along = mean - half_difference
    across = mean + half_difference
    state%energy_density = (along**2 + across**2 - 2*form%ratio*along*across)/(2*form%modulus) &
      & + aimag(shear_part)**2/(2*mu)
    state%knows_stress = .true.
    ! the rotation of Kolosov's solution: mu (du_2/dx_1 - du_1/dx_2) = (kappa + 1) Im(phi')
    turn = (kappa + 1)/(2*mu)*aimag(phi1)
    associate (c => form%axis, shear => aimag(shear_part))
      state%gradient(c, c) = (along - form%ratio*across)/form%modulus
      state%gradient(other, other) = (across - form%ratio*along)/form%modulus
      state%gradient(c, other) = shear/(2*mu) - turn
      state%gradient(other, c) = shear/(2*mu) + turn
      state%stress(c, c) = along
      state%stress(other, other) = across
      state%stress(c, other) = shear
      state%stress(other, c) = shear
      state%stress(3, 3) = form%across*(along + across)
    end associate
  end subroutine hole

  !> Displacements and velocities of one wave number k on an endless chain stay of that wave number
  !> and turn with its frequency: u = u0 cos(omega t) + v0 sin(omega t)/omega at every point.
  pure subroutine chain(form, x, t, state)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(in) :: x, t
    type(exact_type), intent(inout) :: state
    integer :: j

    j = nint((x - form%origin(1))/form%spacing + 0.5_wp)
    state%known = j >= 1 .and. j <= size(form%u)
    if (.not. state%known) return
    state%knows_velocity = .true.
    associate (w => form%frequency)
      state%displacement(1) = form%u(j)*cos(w*t) + form%v(j)*sin(w*t)/w
      state%velocity(1) = form%v(j)*cos(w*t) - form%u(j)*sin(w*t)*w
    end associate
  end subroutine chain

  !> omega [1/s] of wave number `k` [1/m] on an endless chain of the horizon `delta` [m]:
  !> rho omega^2 = 4 E/delta^2 sum_j fraction(j) (1 - cos(k j h))/j over the neighbours j = 1, 2, ..
  !> on one side; `fraction` are their volume corrections.
  pure real(wp) function chain_frequency(k, spacing, delta, modulus, density, fraction) &
      & result(frequency)
    real(wp), intent(in) :: k            !! wave number [1/m]
    real(wp), intent(in) :: spacing      !! h, of the points [m]
    real(wp), intent(in) :: delta        !! horizon [m]
    real(wp), intent(in) :: modulus      !! E, surface correction included [Pa]
    real(wp), intent(in) :: density      !! rho [kg/m3]
    real(wp), intent(in) :: fraction(:)  !! (neighbours on one side), volume corrections of the
                                         !! nearest first [-]
    real(wp) :: total
    integer :: j

    total = 0.0_wp
    do j = 1, size(fraction)
      total = total + fraction(j)*(1 - cos(k*j*spacing))/j
    end do
    frequency = sqrt(4*modulus/(density*delta**2)*total)
  end function chain_frequency

end module pd_study_trade_closed_form
