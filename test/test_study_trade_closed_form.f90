!> Closed forms: they must satisfy the equations and conditions that they answer.
module test_study_trade_closed_form
  use pd_base_kinds, only: wp
  use pd_base_numbers, only: pi
  use pd_output_fields_table, only: all_fields, field_table_type
  use pd_study_trade_closed_form, only: chain_frequency, closed_form_type, field_at, form_chain, &
    & form_hole, form_linear, form_wave
  use bodies, only: expect, expect_true
  use comparisons, only: expect_close
  use testdrive, only: error_type, new_unittest, unittest_type
  implicit none (type, external)
  private
  public :: collect_study_trade_closed_form

contains

  subroutine collect_study_trade_closed_form(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('the bar''s wave is its Fourier series', test_wave), &
      & new_unittest('the wave keeps its energy', test_wave_energy), &
      & new_unittest('the hole is free of traction', test_hole_edge), &
      & new_unittest('the plate around the hole is in balance', test_hole_balance), &
      & new_unittest('far from the hole stress is uniaxial', test_hole_far), &
      & new_unittest('energy of a linear field by the law of Hooke', test_linear), &
      & new_unittest('a chain vibrates with its frequency', test_chain)]
  end subroutine collect_study_trade_closed_form

  real(wp) function value_of(form, field, x, t)
    type(closed_form_type), intent(in) :: form
    character(*), intent(in) :: field
    real(wp), intent(in) :: x(:), t
    real(wp) :: values(1)
    logical :: known
    type(field_table_type) :: table
    table = all_fields()
    call field_at(form, table%field(field), x, t, values, known)
    value_of = merge(values(1), huge(1.0_wp), known)
  end function value_of

  pure type(closed_form_type) function bar(side) result(form)
    real(wp), intent(in) :: side
    form%kind = form_wave
    form%modulus = 3.0_wp
    form%length = 2.0_wp
    form%origin(1) = 0.7_wp
    form%side = side
    form%gradient(1, 1) = 1.0e-3_wp
    form%speed = 1.5_wp
  end function bar

  !> u = 8 eps L/pi^2 sum (-1)^n/(2n+1)^2 sin(k x) cos(k c t), k = (2n+1) pi/(2L): the remainder
  !> behind N terms is below 2 eps L/(pi^2 N).
  subroutine test_wave(error)
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    integer, parameter :: terms = 4000
    real(wp) :: x, t, sum_of, k
    integer :: i, n, s

    do s = -1, 1, 2
      form = bar(real(s, wp))
      do i = 1, 40
        x = 2.0_wp*modulo(0.37_wp*i, 1.0_wp)
        t = 0.29_wp*i
        sum_of = 0.0_wp
        do n = 0, terms
          k = (2*n + 1)*pi/4
          sum_of = sum_of + (-1)**n/real(2*n + 1, wp)**2*sin(k*x)*cos(k*1.5_wp*t)
        end do
        call expect(error, value_of(form, 'displacement', [0.7_wp + s*x], t), &
          & s*8*1.0e-3_wp*2/pi**2*sum_of, 2*1.0e-3_wp*2/(pi**2*terms), 'displacement')
      end do
    end do
    ! the velocity is the displacement's rate
    do i = 1, 20
      x = 0.7_wp + 2.0_wp*modulo(0.37_wp*i, 1.0_wp)
      t = 0.29_wp*i
      form = bar(1.0_wp)
      call expect(error, value_of(form, 'velocity', [x], t), &
        & (value_of(form, 'displacement', [x], t + 1.0e-6_wp) &
        & - value_of(form, 'displacement', [x], t - 1.0e-6_wp))/2.0e-6_wp, 1.0e-10_wp, 'velocity')
    end do
  end subroutine test_wave

  !> Kinetic and strain energy together stay E eps^2 L/2 for an area of 1; midpoints of 2000 parts
  !> miss the jumps by at most 4 parts.
  subroutine test_wave_energy(error)
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    integer, parameter :: parts = 2000
    real(wp) :: energy, x, rho
    integer :: i, j

    form = bar(1.0_wp)
    rho = form%modulus/form%speed**2
    do j = 0, 6
      energy = 0.0_wp
      do i = 1, parts
        x = 0.7_wp + 2.0_wp*(i - 0.5_wp)/parts
        energy = energy + 2.0_wp/parts*(value_of(form, 'energy_density', [x], 0.61_wp*j) &
          & + rho/2*value_of(form, 'velocity', [x], 0.61_wp*j)**2)
      end do
      call expect(error, energy, 3.0_wp*1.0e-6_wp, 3.0e-6_wp*4/parts, 'energy')
    end do
  end subroutine test_wave_energy

  pure type(closed_form_type) function plate() result(form)
    form%kind = form_hole
    form%dim = 2
    form%modulus = 7.0_wp
    form%ratio = 0.3_wp
    form%radius = 0.5_wp
    form%stress = 2.0_wp
    form%origin(:2) = [0.1_wp, -0.2_wp]
    form%axis = 2
  end function plate

  !> Stress (xx, yy, xy) from differences of the displacement, plane stress.
  function stress_at(form, x) result(stress)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(in) :: x(2)
    real(wp) :: stress(3)
    real(wp), parameter :: step = 1.0e-5_wp
    real(wp) :: up(2), down(2), h(2, 2)
    type(field_table_type) :: table
    logical :: known
    integer :: c

    table = all_fields()
    do c = 1, 2
      up = x
      up(c) = up(c) + step
      down = x
      down(c) = down(c) - step
      call field_at(form, table%field('displacement'), up, 0.0_wp, h(:, c), known)
      call field_at(form, table%field('displacement'), down, 0.0_wp, stress(:2), known)
      h(:, c) = (h(:, c) - stress(:2))/(2*step)
    end do
    associate (e => form%modulus, nu => form%ratio)
      stress = [e/(1 - nu**2)*(h(1, 1) + nu*h(2, 2)), e/(1 - nu**2)*(h(2, 2) + nu*h(1, 1)), &
        & e/(2*(1 + nu))*(h(1, 2) + h(2, 1))]
    end associate
  end function stress_at

  !> Hold a form to values of a field, to the error of the differences.
  subroutine expect_values(error, form, field, x, values)
    type(error_type), allocatable, intent(inout) :: error
    type(closed_form_type), intent(in) :: form
    character(*), intent(in) :: field
    real(wp), intent(in) :: x(:), values(:)
    real(wp) :: found(size(values))
    type(field_table_type) :: table
    logical :: known

    table = all_fields()
    call field_at(form, table%field(field), x, 0.0_wp, found, known)
    call expect_true(error, known, field//' is known')
    call expect_close(error, found, values, 1.0e-8_wp, field)
  end subroutine expect_values

  !> F row by row, from differences of the displacement.
  function gradient_at(form, x) result(gradient)
    type(closed_form_type), intent(in) :: form
    real(wp), intent(in) :: x(2)
    real(wp) :: gradient(4)
    real(wp), parameter :: step = 1.0e-5_wp
    real(wp) :: up(2), down(2), there(2)
    type(field_table_type) :: table
    logical :: known
    integer :: c

    table = all_fields()
    do c = 1, 2
      up = x
      up(c) = up(c) + step
      down = x
      down(c) = down(c) - step
      call field_at(form, table%field('displacement'), up, 0.0_wp, there, known)
      gradient([c, c + 2]) = there
      call field_at(form, table%field('displacement'), down, 0.0_wp, there, known)
      gradient([c, c + 2]) = (gradient([c, c + 2]) - there)/(2*step)
    end do
    gradient([1, 4]) = gradient([1, 4]) + 1
  end function gradient_at

  !> At the rim (a hair outside, for the differences) no traction; hoop stress S(1 - 2 cos 2 theta),
  !> 3 S beside the load. Differences err by 1e-9.
  subroutine test_hole_edge(error)
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    real(wp) :: angle, n(2), s(3), hoop
    integer :: i

    form = plate()
    do i = 0, 11
      angle = 2*pi*i/12
      n = [cos(angle), sin(angle)]
      s = stress_at(form, form%origin(:2) + form%radius*(1 + 3.0e-5_wp)*n)
      ! the traction grows from 0 at a rate of order S/a
      call expect(error, s(1)*n(1) + s(3)*n(2), 0.0_wp, 1.0e-3_wp, 'traction x')
      call expect(error, s(3)*n(1) + s(2)*n(2), 0.0_wp, 1.0e-3_wp, 'traction y')
      hoop = s(1)*n(2)**2 + s(2)*n(1)**2 - 2*s(3)*n(1)*n(2)
      ! theta counts from the load, which is along y
      call expect(error, hoop, 2.0_wp*(1 - 2*cos(2*(angle - pi/2))), 2.0e-3_wp, 'hoop stress')
    end do
  end subroutine test_hole_edge

  !> The divergence of the stress vanishes; second differences err by 1e-4 here. Dilatation and
  !> energy are those of the displacement.
  subroutine test_hole_balance(error)
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    real(wp), parameter :: step = 1.0e-3_wp
    real(wp) :: x(2), right(3), left(3), up(3), down(3), s(3)
    integer :: i

    form = plate()
    do i = 1, 20
      x = form%origin(:2) + (0.6_wp + 0.1_wp*i)*[cos(1.0_wp*i), sin(1.0_wp*i)]
      right = stress_at(form, x + [step, 0.0_wp])
      left = stress_at(form, x - [step, 0.0_wp])
      up = stress_at(form, x + [0.0_wp, step])
      down = stress_at(form, x - [0.0_wp, step])
      call expect(error, (right(1) - left(1) + up(3) - down(3))/(2*step), 0.0_wp, 2.0e-4_wp, &
        & 'balance x')
      call expect(error, (right(3) - left(3) + up(2) - down(2))/(2*step), 0.0_wp, 2.0e-4_wp, &
        & 'balance y')
      s = stress_at(form, x)
      call expect_values(error, form, 'stress', x, [s(1), s(2), 0.0_wp, s(3)])
      call expect_values(error, form, 'von_mises', x, [sqrt(s(1)**2 + s(2)**2 - s(1)*s(2) &
        & + 3*s(3)**2)])
      call expect_values(error, form, 'deformation_gradient', x, gradient_at(form, x))
      call expect(error, value_of(form, 'dilatation', x, 0.0_wp), (1 - 0.3_wp)*(s(1) + s(2)) &
        & /7.0_wp, 1.0e-8_wp, 'dilatation')
      call expect(error, value_of(form, 'energy_density', x, 0.0_wp), (s(1)**2 + s(2)**2 &
        & - 0.6_wp*s(1)*s(2))/14 + s(3)**2*1.3_wp/7, 1.0e-8_wp, 'energy')
    end do
    call expect_true(error, value_of(form, 'dilatation', form%origin(:2), 0.0_wp) &
      & > 0.9_wp*huge(1.0_wp), 'nothing is known inside the hole')
  end subroutine test_hole_balance

  !> The hole's part falls with (a/r)^2: 1e-6 at a thousand radii.
  subroutine test_hole_far(error)
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    real(wp) :: s(3)

    form = plate()
    s = stress_at(form, [300.0_wp, 400.0_wp])
    call expect(error, s(1), 0.0_wp, 2.0e-5_wp, 'across the load')
    call expect(error, s(2), 2.0_wp, 2.0e-5_wp, 'along the load')
    call expect(error, s(3), 0.0_wp, 2.0e-5_wp, 'shear')
  end subroutine test_hole_far

  !> Half of stress times strain; in plane stress with the thickness strain that makes the stress
  !> across vanish.
  subroutine test_linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    real(wp), parameter :: e = 5.0_wp, nu = 0.2_wp
    real(wp) :: strain(3, 3), stress(3, 3), lame, mu
    integer :: c, d

    form%kind = form_linear
    form%modulus = e
    form%ratio = nu
    form%gradient = reshape([1.0_wp, 0.4_wp, -0.3_wp, 0.2_wp, -2.0_wp, 0.5_wp, 0.6_wp, 0.1_wp, &
      & 0.7_wp], [3, 3])
    lame = e*nu/((1 + nu)*(1 - 2*nu))
    mu = e/(2*(1 + nu))
    do d = 2, 3
      form%dim = d
      strain = (form%gradient + transpose(form%gradient))/2
      if (d == 2) then
        strain(3, :) = 0.0_wp
        strain(:, 3) = 0.0_wp
        strain(3, 3) = -nu/(1 - nu)*(strain(1, 1) + strain(2, 2))
      end if
      stress = 2*mu*strain
      do c = 1, 3
        stress(c, c) = stress(c, c) + lame*(strain(1, 1) + strain(2, 2) + strain(3, 3))
      end do
      call expect(error, value_of(form, 'energy_density', spread(0.0_wp, 1, d), 0.0_wp), &
        & sum(stress*strain)/2, 1.0e-13_wp, 'energy')
      if (d == 2) then
        ! the moduli of the plane: E and nu are those of plane stress
        call expect_values(error, form, 'stress', spread(0.0_wp, 1, d), [stress(1, 1), &
          & stress(2, 2), 0.0_wp, stress(1, 2)])
      else
        call expect_values(error, form, 'stress', spread(0.0_wp, 1, d), [stress(1, 1), &
          & stress(2, 2), stress(3, 3), stress(1, 2), stress(2, 3), stress(1, 3)])
      end if
    end do
  end subroutine test_linear

  !> The answer obeys the chain's equation of motion at every point: bonds of stiffness
  !> 2 E/(delta^2) fraction/j to each side, found by differences in time.
  subroutine test_chain(error)
    type(error_type), allocatable, intent(out) :: error
    type(closed_form_type) :: form
    real(wp), parameter :: fraction(3) = [1.0_wp, 1.0_wp, 0.5_wp], e = 4.0_wp, rho = 2.0_wp
    real(wp), parameter :: h = 0.25_wp, delta = 0.75_wp, step = 1.0e-3_wp, t = 0.37_wp, k = 3.1_wp
    real(wp) :: a, force, u
    integer :: i, j

    form%kind = form_chain
    form%spacing = h
    form%frequency = chain_frequency(k, h, delta, e, rho, fraction)
    form%u = [(cos(k*i*h), i=1, 30)]
    form%v = [(0.8_wp*sin(k*i*h), i=1, 30)]
    do i = 10, 20
      u = at(i, t)
      a = (at(i, t + step) - 2*u + at(i, t - step))/step**2
      force = 0.0_wp
      do j = 1, 3
        force = force + 2*e/delta**2*fraction(j)/j*(at(i + j, t) - 2*u + at(i - j, t))
      end do
      call expect(error, rho*a, force, 1.0e-4_wp, 'equation of motion')
    end do

  contains

    real(wp) function at(point, time)
      integer, intent(in) :: point
      real(wp), intent(in) :: time
      at = value_of(form, 'displacement', [(point - 0.5_wp)*h], time)
    end function at
  end subroutine test_chain

end module test_study_trade_closed_form
