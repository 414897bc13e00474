!> Horizons that points have of their own: families and volumes against every pair of points, forces
!> that keep momentum and are the gradient of the energy, bars against sums over their bonds, cracks
!> against Gc, and what is refused.
module test_set_up_horizons
  use bodies, only: at_point, expect_true, noise, shake
  use comparisons, only: expect_close, max_abs, text_of
  use force_subjects, only: some_gradient
  use pd_force_term, only: term_view_type
  use meshes, only: write_file
  use pd_base_kinds, only: wp, i1
  use pd_base_numbers, only: pi
  use pd_base_text, only: to_text
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_family_lattice, only: lattice_family_type
  use pd_family_volume, only: covered_fraction
  use pd_force_forces, only: energy_pass, internal_force
  use pd_force_model, only: bond_limit, options_of
  use pd_force_reference, only: reference_energy, reference_force, state_of_bond
  use pd_law_material, only: never
  use pd_motion_explicit_spectrum, only: largest_frequency, spectrum_type
  use pd_motion_system, only: system_type, view_of
  use pd_set_up_prepare, only: prepare, set_up_type
  use perifort, only: answer_type, fault_type => error_type, read_scene_text, run_options_type, &
    & run_scene, scene_type
  use runs, only: ready_text, refuse_text => refuse
  use testdrive, only: check, error_type, new_unittest, test_failed, unittest_type
  use test_scene_expect, only: expect_fault, line
  implicit none (type, external)
  private
  public :: collect_set_up_horizons

  character(*), parameter :: local = '&horizon local = .true. '
  character(*), parameter :: ball = "&rigid name = 'ball' shape = 'sphere' radius = 0.5 "// &
    & 'centre = 0, -0.5 mass = 1 /'//line//"&contact between = 'a', 'ball' distance = 0.12 /"// &
    & line//"&contact between = 'b', 'ball' distance = 0.12 /"//line//'&time steps = 1 /'//line
  character(*), parameter :: relaxes = "&time method = 'relaxation' /"//line

contains

  subroutine collect_set_up_horizons(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('families reach as far as the larger horizon', test_families), &
      & new_unittest('momentum, energy and fast loops of clouds', test_forces), &
      & new_unittest('the same bits on any number of threads', test_threads), &
      & new_unittest('one grid stays as it is', test_one_grid), &
      & new_unittest('lattices of two spacings have two horizons, unless a length is given', &
      & test_two_spacings), &
      & new_unittest('away from where grids meet, each is as if alone', test_alone), &
      & new_unittest('a graded bar in tension', test_tension), &
      & new_unittest('waves in a graded bar', test_waves), &
      & new_unittest('long: two grids in tension', test_grids), &
      & new_unittest('bonds through a plane hold Gc', test_toughness), &
      & new_unittest('a given critical stretch holds for all bonds', test_given_stretch), &
      & new_unittest('the time step', test_step), &
      & new_unittest('layers have the horizon of their side', test_layers), &
      & new_unittest('facets of meshes move points within their own horizon', test_facets), &
      & new_unittest('contact has the larger horizon of a pair', test_contact), &
      & new_unittest('what is refused', test_refusals)]
  end subroutine collect_set_up_horizons

  ! ---------------------------------------------------------------- subjects

  !> A cloud in the box from `lower` [m] with edges of 1 m: a grid of `n` points along each
  !> direction, shaken, with volumes that differ by a factor of up to 8.
  subroutine write_cloud(name, dim, n, lower, seed)
    character(*), intent(in) :: name
    integer, intent(in) :: dim, n, seed
    real(wp), intent(in) :: lower
    character(:), allocatable :: text
    real(wp) :: x(3), h
    integer :: state, i, c, cell(3)

    text = ''
    h = 1.0_wp/n
    state = seed
    do i = 0, n**dim - 1
      cell = [mod(i, n), mod(i/n, n), i/n**2]
      x = 0.0_wp
      do c = 1, dim
        x(c) = (cell(c) + 0.5_wp)*h + 0.3_wp*h*noise(state)
      end do
      x(1) = x(1) + lower
      do c = 1, 3
        text = text//text_of(x(c))//' '
      end do
      text = text//text_of(h**dim*8.0_wp**(0.5_wp*noise(state)))//line
    end do
    call write_file(name, text)
  end subroutine write_cloud

  !> Two clouds side by side.
  function clouds(dim, n, material, horizon, more) result(text)
    integer, intent(in) :: dim, n
    character(*), intent(in) :: material, horizon, more
    character(:), allocatable :: text

    call write_cloud('horizons_1.txt', dim, n, 0.0_wp, 11)
    call write_cloud('horizons_2.txt', dim, n, 1.0_wp, 12)
    text = '&scene dimension = '//to_text(dim)//' thickness = 1.0 area = 1.0 /'//line// &
      & "&body name = 'a' file = 'build/horizons_1.txt' material = 'm' /"//line// &
      & "&body name = 'b' file = 'build/horizons_2.txt' material = 'n' /"//line// &
      & "&material name = 'm' youngs_modulus = 2e11 density = 8e3 "//material//' /'//line// &
      & "&material name = 'n' youngs_modulus = 1e11 density = 4e3 "//material//' /'//line// &
      & local//horizon//' /'//line//relaxes//more
  end function clouds

  !> A chain from 0 to 1 whose cells grow by `growth` from one to the next.
  subroutine write_chain(name, n, growth, x, volume)
    character(*), intent(in) :: name
    integer, intent(in) :: n
    real(wp), intent(in) :: growth
    real(wp), intent(out) :: x(:), volume(:)
    character(:), allocatable :: text
    integer :: i

    volume = [(growth**i, i=0, n - 1)]
    volume = volume/sum(volume)
    text = ''
    do i = 1, n
      x(i) = sum(volume(:i - 1)) + volume(i)/2
      text = text//text_of(x(i))//' 0 0 '//text_of(volume(i))//line
    end do
    call write_file(name, text)
  end subroutine write_chain

  !> Two grids side by side, 1 m high in 2D: spacings of 1/n m for x < 0 and of half of that beyond.
  function grids(n, material, horizon, more) result(text)
    integer, intent(in) :: n
    character(*), intent(in) :: material, horizon, more
    character(:), allocatable :: text

    text = '&scene dimension = 2 thickness = 1.0 /'//line// &
      & "&body name = 'a' lower = -1, 0 upper = 0, 1 points = 2*"//to_text(n)//' /'//line// &
      & "&body name = 'b' lower = 0, 0 upper = 1, 1 points = 2*"//to_text(2*n)//' /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 '//material//' /'//line// &
      & local//horizon//' /'//line//more
  end function grids

  !> The same two bodies with the given groups alone.
  function own_grids(more) result(text)
    character(*), intent(in) :: more
    character(:), allocatable :: text
    character(:), allocatable :: of_local

    of_local = grids(8, 'poissons_ratio = 0.2', '', '')
    text = of_local(:index(of_local, local) - 1)//more
  end function own_grids

  subroutine force_at(system, u, force)
    type(system_type), intent(inout) :: system
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp), allocatable, intent(out) :: force(:, :)
    real(wp), allocatable :: p(:)
    integer(i1), allocatable :: strained(:)

    allocate (force(size(u, 1), size(u, 2)), p(size(u, 1)), source=0.0_wp)
    allocate (strained(size(u, 1)), source=0_i1)
    call internal_force(system%body, system%family, system%model, options_of(system%model), &
      & system%workspace, u, p, force, strained)
  end subroutine force_at

  !> Strain energy of the body [J].
  real(wp) function energy_at(system, u) result(energy)
    type(system_type), intent(inout) :: system
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp) :: density(size(u, 1))
    call energy_pass(system%family, system%model, system%workspace, u, density)
    energy = sum(density*system%body%volume)
  end function energy_at

  ! ---------------------------------------------------------------- families

  !> Members and volumes of every point by comparing all pairs, for each volume correction, in 1D to
  !> 3D. Volumes are products of a few numbers.
  subroutine test_families(error)
    type(error_type), allocatable, intent(out) :: error
    character(15), parameter :: rules(4) = [character(15) :: 'none', 'linear', 'linear_extended', &
      & 'exact']
    integer, parameter :: counts(3) = [60, 16, 7]
    integer :: dim, r

    do dim = 1, 3
      do r = 1, size(rules)
        call expect_families(trim(rules(r)))
        if (allocated(error)) return
      end do
    end do

  contains

    subroutine expect_families(rule)
      character(*), intent(in) :: rule
      real(wp), parameter :: ratio = 2.2_wp
      type(set_up_type) :: set_up
      type(bonds_type) :: bonds
      real(wp), allocatable :: weight(:)
      real(wp) :: xi(3), delta, h, reach
      integer :: k, j, different

      call ready_text(clouds(dim, counts(dim), 'poissons_ratio = 0.3', &
        & "ratio = 2.2 volume_correction = '"//rule//"'", ''), set_up, error)
      if (allocated(error)) return
      associate (body => set_up%system%body, family => set_up%system%family)
        different = 0
        call allocate_bonds(family, bonds)
        allocate (weight(body%n_slots))
        do k = 1, body%n_slots
          if (body%point(k) == 0) cycle
          call family%bonds_of(k, bonds)
          weight = 0.0_wp
          weight(bonds%j(:bonds%n)) = bonds%weight(:bonds%n)
          do j = 1, body%n_slots
            if (body%point(j) == 0 .or. j == k) cycle
            xi = 0.0_wp
            xi(:dim) = body%x(j, :) - body%x(k, :)
            delta = ratio*max(body%spacing(k), body%spacing(j))
            h = (body%spacing(k) + body%spacing(j))/2
            reach = delta
            if (rule == 'linear_extended') reach = delta + h/2
            if (rule == 'exact') reach = delta + h/2*sqrt(real(dim, wp))
            if (norm2(xi) > reach) then
              call check(error, .not. any(bonds%j(:bonds%n) == j), 'a bond too many, '//rule)
            else
              ! the smaller of both horizons would not have it
              if (norm2(xi) > ratio*min(body%spacing(k), body%spacing(j))) different = different + 1
              call check(error, any(bonds%j(:bonds%n) == j), 'a bond is missing, '//rule)
              call expect_close(error, weight(j)/body%volume(j), part_of_volume(rule, xi(:dim), h, &
                & delta), 1.0e-12_wp, 'volume correction, '//rule)
            end if
            if (allocated(error)) return
          end do
        end do
      end associate
      call expect_true(error, different > 20, 'too few bonds by the larger horizon')
    end subroutine expect_families

    !> v_c of a bond.
    real(wp) function part_of_volume(rule, xi, h, delta)
      character(*), intent(in) :: rule
      real(wp), intent(in) :: xi(:), h, delta

      select case (rule)
      case ('none')
        part_of_volume = 1.0_wp
      case ('exact')
        part_of_volume = covered_fraction(xi, h, delta)
      case default  ! linear
        part_of_volume = max(0.0_wp, min(1.0_wp, (delta + h/2 - norm2(xi))/h))
      end select
    end function part_of_volume

  end subroutine test_families

  ! ---------------------------------------------------------------- forces

  !> Two clouds of two materials, with surface factors and both influence functions: the net force
  !> and moment vanish to some hundred roundings, fast and general loops agree with the theory as
  !> it is written, and forces are differences of the energy. Central differences of 1e-6 of a
  !> spacing have errors of eps E/(h F), 1e-7 of the largest force.
  subroutine test_forces(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: counts(3) = [40, 14, 6]
    character(21), parameter :: influences(2) = [character(21) :: "", "influence='constant'"]
    integer :: dim, i

    do dim = 1, 3
      do i = 1, size(influences)
        call expect_forces(trim(influences(i)), 1.0e-3_wp)
        call expect_forces(trim(influences(i)), 0.2_wp)  ! beyond the fast loops
        if (allocated(error)) return
      end do
    end do

  contains

    subroutine expect_forces(influence, strain)
      character(*), intent(in) :: influence
      real(wp), intent(in) :: strain
      type(set_up_type) :: set_up
      real(wp), allocatable :: u(:, :), force(:, :), expected(:, :), density(:)
      real(wp) :: gradient(3, 3), net(3), moment(3), y(3), f(3), applied, h, slope
      integer, parameter :: chosen(3) = [5, 17, 30]
      integer :: k, i, c

      call ready_text(clouds(dim, counts(dim), 'poissons_ratio = 0.2 '//influence, &
        & 'ratio = 2.5', ''), set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        allocate (u(system%body%n_slots, dim), expected(system%body%n_slots, dim))
        allocate (density(system%body%n_slots))
        gradient = strain*reshape([1.0_wp, 0.3_wp, -0.2_wp, 0.5_wp, -0.7_wp, 0.1_wp, 0.4_wp, &
          & 0.2_wp, 0.6_wp], [3, 3])
        call shake(system%body, gradient, 0.1_wp*strain/counts(dim), 3, u)
        call force_at(system, u, force)
        call reference_force(system%family, system%model, u, expected)
        call expect_close(error, force, expected, 1.0e-12_wp*max_abs(expected), 'loops')
        call reference_energy(system%family, system%model, u, density)
        call expect_close(error, energy_at(system, u), sum(density*system%body%volume), &
          & 1.0e-12_wp*sum(density*system%body%volume), 'energies')
        net = 0.0_wp
        moment = 0.0_wp
        applied = 0.0_wp
        do k = 1, system%body%n_slots
          y = 0.0_wp
          f = 0.0_wp
          y(:dim) = system%body%x(k, :) + u(k, :)
          f(:dim) = force(k, :)*system%body%volume(k)
          net = net + f
          moment = moment + [y(2)*f(3) - y(3)*f(2), y(3)*f(1) - y(1)*f(3), y(1)*f(2) - y(2)*f(1)]
          applied = applied + sum(abs(f))
        end do
        call expect_true(error, applied > 0.0_wp, 'no force')
        call expect_close(error, net, 0.0_wp, 1.0e-13_wp*applied, 'net force')
        call expect_close(error, moment, 0.0_wp, 2.0e-13_wp*applied, 'net moment')
        h = 1.0e-6_wp/counts(dim)
        do i = 1, size(chosen)
          k = system%body%slot(chosen(i))
          do c = 1, dim
            u(k, c) = u(k, c) + h
            slope = energy_at(system, u)
            u(k, c) = u(k, c) - 2*h
            slope = (slope - energy_at(system, u))/(2*h)
            u(k, c) = u(k, c) + h
            call expect_close(error, -slope, force(k, c)*system%body%volume(k), 1.0e-7_wp*max_abs( &
              & force*spread(system%body%volume, 2, dim)) &
              & + 20*epsilon(1.0_wp)*sum(density*system%body%volume)/h, 'gradient of the energy')
          end do
        end do
      end associate
    end subroutine expect_forces

  end subroutine test_forces

  subroutine test_threads(error)
    use omp_lib, only: omp_get_max_threads, omp_set_num_threads
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :), force(:, :), first(:, :)
    real(wp) :: gradient(3, 3)
    integer :: threads, n

    threads = omp_get_max_threads()
    do n = 1, 3
      call omp_set_num_threads(n)
      call ready_text(clouds(2, 14, 'poissons_ratio = 0.2', 'ratio = 2.5', ''), set_up, error)
      if (allocated(error)) exit
      if (n == 1) allocate (u(set_up%system%body%n_slots, 2))
      gradient = 1.0e-3_wp
      call shake(set_up%system%body, gradient, 1.0e-5_wp, 3, u)
      call force_at(set_up%system, u, force)
      if (n == 1) first = force
      call check(error, all(abs(force - first) <= 0.0_wp), 'forces')
      if (allocated(error)) exit
    end do
    call omp_set_num_threads(threads)
  end subroutine test_threads

  !> Where all points have one spacing, `local` changes nothing, to the last bit.
  subroutine test_one_grid(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: text = '&scene dimension = 2 thickness = 1.0 /'//line// &
      & '&body lower = 0, 0 upper = 2, 1 points = 20, 10 /'//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.2 /'//line//relaxes// &
      & "&boundary side = 'x_min' displacement_x = 0 /"//line
    type(set_up_type) :: one, other
    real(wp), allocatable :: u(:, :), force(:, :), expected(:, :)
    real(wp) :: gradient(3, 3)

    call ready_text(text, other, error)
    call ready_text(text//local//' /', one, error)
    if (allocated(error)) return
    select type (family => one%system%family)
    type is (lattice_family_type)
      allocate (u(family%n_slots, 2))
    class default
      call test_failed(error, 'no lattice family')
      return
    end select
    gradient = 1.0e-3_wp
    call shake(one%system%body, gradient, 1.0e-5_wp, 3, u)
    call force_at(one%system, u, force)
    call force_at(other%system, u, expected)
    call check(error, all(abs(force - expected) <= 0.0_wp) .and. max_abs(expected) > 0.0_wp, &
      & 'forces')
  end subroutine test_one_grid

  !> Points whose families, and those of whose members, lie on one of two grids have the force and
  !> the energy that they have without the other one: constants, volumes and surface factors are
  !> those of their own horizon. Forces are differences of sums: some roundings of one bond's force.
  subroutine test_alone(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: material = 'poissons_ratio = 0.2 '
    type(set_up_type) :: both, alone
    character(:), allocatable :: text
    integer :: b, n

    do n = 1, 2
      call ready_text(grids(16, material//merge("influence='linear'", &
        & repeat(' ', 18), n == 2), 'ratio = 2.015', relaxes), both, error)
      do b = 1, 2
        text = '&scene dimension = 2 thickness = 1.0 /'//line// &
          & '&material youngs_modulus = 2e11 density = 8e3 '//material// &
          & merge("influence='linear'", repeat(' ', 18), n == 2)// &
          & ' /'//line//'&horizon ratio = 2.015 /'//line//relaxes//'&body lower = '// &
          & to_text(b - 2)//', 0 upper = '//to_text(b - 1)//', 1 points = 2*'//to_text(16*b)//' /'
        call ready_text(text, alone, error)
        if (allocated(error)) return
        call expect_same(alone%system, 1.0_wp/(16*b))
        if (allocated(error)) return
      end do
    end do

  contains

    subroutine expect_same(one, h)
      type(system_type), intent(inout) :: one
      real(wp), intent(in) :: h
      real(wp), allocatable :: u(:, :), v(:, :), force(:, :), expected(:, :), energy(:), density(:)
      integer :: k, j, compared

      allocate (u(one%body%n_slots, 2), density(one%body%n_slots))
      allocate (v(both%system%body%n_slots, 2), energy(both%system%body%n_slots))
      u = smooth(one%body%x)
      v = smooth(both%system%body%x)
      call force_at(one, u, expected)
      call force_at(both%system, v, force)
      call energy_pass(one%family, one%model, one%workspace, u, density)
      call energy_pass(both%system%family, both%system%model, both%system%workspace, v, energy)
      compared = 0
      do k = 1, one%body%n_slots
        if (one%body%point(k) == 0) cycle
        ! three times the longest horizon of 2.015/16 away from the other grid
        if (abs(one%body%x(k, 1)) < 6.1_wp/16) cycle
        compared = compared + 1
        j = at_point(both%system%body, one%body%x(k, :))
        call expect_close(error, force(j, :), expected(k, :), 1.0e-11_wp*2.0e11_wp*1.0e-3_wp/h, &
          & 'force')
        call expect_close(error, energy(j), density(k), 1.0e-12_wp*2.0e11_wp*1.0e-6_wp, 'energy')
        if (allocated(error)) return
      end do
      call expect_true(error, compared > 100 .and. max_abs(expected) > 1.0e8_wp, 'too few points')
    end subroutine expect_same

    !> A displacement of some 1e-3 [m].
    function smooth(x) result(u)
      real(wp), intent(in) :: x(:, :)
      real(wp) :: u(size(x, 1), 2)
      u(:, 1) = 1.0e-3_wp*(x(:, 1) + sin(3*x(:, 1))*cos(2*x(:, 2)))
      u(:, 2) = 1.0e-3_wp*(sin(2*x(:, 1) + x(:, 2)) - 0.5_wp*x(:, 2)**2)
    end function smooth

  end subroutine test_alone

  ! ---------------------------------------------------------------- bars and plates

  !> A bar whose cells grow by 5 % from one to the next. Families are similar, so that all have one
  !> surface factor S and a uniform strain is in equilibrium; the force through the middle of the
  !> chain is a sum over the bonds there. The strain under a force is that to the residual of the
  !> solver, and, since quadrature errors are even in the growth, F/(E A) to its square.
  subroutine test_tension(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 100
    real(wp), parameter :: growth = 1.05_wp, ratio = 3.015_wp
    type(scene_type) :: scene
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :)
    real(wp) :: x(n), h(n), stiffness, s, strain
    integer :: i, j, m

    call write_chain('horizons_bar.txt', n, growth, x, h)
    call read_scene_text('&scene dimension = 1 area = 1.0 /'//line// &
      & "&body file = 'build/horizons_bar.txt' /"//line// &
      & '&material youngs_modulus = 1.0 density = 1.0 /'//line//local//' /'//line//relaxes// &
      & '&relaxation tolerance = 1e-11 /'//line// &
      & "&region name = 'first' shape = 'box' lower = 0 upper = "//text_of(h(1))//' /'//line// &
      & "&region name = 'last' shape = 'box' lower = "//text_of(1 - h(n))//' upper = 1 /'// &
      & line//"&load region = 'first' force_x = -1e-3 /"//line// &
      & "&load region = 'last' force_x = 1e-3 /"//line//"&output fields = 'displacement' /", &
      & '', scene, fault)
    if (.not. allocated(fault)) call run_scene(scene, run_options_type(quiet=.true., &
      & files=.false.), fault, answer=answer)
    if (.not. allocated(fault)) call answer%get_field('displacement', u, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    ! S of the middle point: E/2 = (1/2) S sum q |xi| vc V, q = E/(delta^2 A)
    m = n/2
    s = 0.0_wp
    do j = 1, n
      if (j /= m) s = s + pull(m, j)*h(j)
    end do
    s = 1/s
    ! force through a plane: 2 q S strain vc V_i V_j of each bond
    stiffness = 0.0_wp
    do i = 1, m
      do j = m + 1, n
        stiffness = stiffness + 2*s*pull(i, j)/(x(j) - x(i))*h(i)*h(j)
      end do
    end do
    strain = (u(m + 10, 1) - u(m - 10, 1))/(x(m + 10) - x(m - 10))
    call expect_close(error, strain, 1.0e-3_wp/stiffness, 1.0e-11_wp, 'the sum over bonds')
    call expect_close(error, strain, 1.0e-3_wp, 1.0e-3_wp*(growth - 1)**2, 'F/(E A)')

  contains

    !> vc |xi|/delta^2 of a bond.
    real(wp) function pull(i, j)
      integer, intent(in) :: i, j
      real(wp) :: delta, length

      delta = ratio*max(h(i), h(j))
      length = abs(x(i) - x(j))
      pull = 0.0_wp
      if (length <= delta) pull = min(1.0_wp, (delta - length)/(h(i) + h(j))*2 + 0.5_wp) &
        & *length/delta**2
    end function pull

  end subroutine test_tension

  !> A free bar whose cells grow by 2 % from one to the next, 7-fold from end to end, in its first
  !> mode: an end passes through 0 at L/(2 c), 3 L/(2 c), .. The error of the speed is below
  !> 0.1 %: that of the stiffness, 4e-4 (the test above), and of the longest horizon, 5.6 % of the
  !> bar, (k delta)^2/24 of which acts on a part.
  subroutine test_waves(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 100
    type(scene_type) :: scene
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: t(:), u(:)
    real(wp) :: x(n), h(n)
    integer :: i, zeros

    call write_chain('horizons_wave.txt', n, 1.02_wp, x, h)
    call read_scene_text('&scene dimension = 1 area = 1.0 /'//line// &
      & "&body file = 'build/horizons_wave.txt' /"//line// &
      & '&material youngs_modulus = 4.0 density = 1.0 /'//line//local//' /'//line// &
      & "&initial displacement_x = '1e-4*cos("//text_of(pi)//"*x)' /"//line// &
      & '&time duration = 1.4 /'//line//"&output history_every = 1 fields = 'displacement' /"// &
      & line//"&probe name = 'end' point = 0 /", '', scene, fault)
    if (.not. allocated(fault)) call run_scene(scene, run_options_type(quiet=.true., &
      & files=.false.), fault, answer=answer)
    if (.not. allocated(fault)) call answer%get_column('time', t, fault)
    if (.not. allocated(fault)) call answer%get_column('end_displacement_x', u, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    zeros = 0
    do i = 1, size(t) - 1
      if (u(i)*u(i + 1) > 0.0_wp) cycle
      call expect_close(error, t(i) - u(i)*(t(i + 1) - t(i))/(u(i + 1) - u(i)), &
        & (2*zeros + 1)/4.0_wp, 1.0e-3_wp*(2*zeros + 1)/4.0_wp, 'zero')
      zeros = zeros + 1
    end do
    call check(error, zeros, 3)
  end subroutine test_waves

  !> Two grids in tension. Alone, the coarse and the fine plate are 1.3 and 0.6 % too stiff by their
  !> long sides, so that the stretch between their middles is within 1 % of that of a uniform
  !> stress. Where the grids meet the stress deviates by up to 8 %, within a horizon, as it does by
  !> up to 20 % near the ends.
  subroutine test_grids(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(answer_type) :: answer
    type(fault_type), allocatable :: fault
    real(wp), allocatable :: u(:, :), stress(:, :), at(:)
    integer :: i, n

    call read_scene_text(grids(20, 'poissons_ratio = 0.3', '', relaxes// &
      & "&load side = 'x_min' body = 'a' pressure = -1e6 /"//line// &
      & "&load side = 'x_max' body = 'b' pressure = -1e6 /"//line// &
      & "&output fields = 'displacement', 'stress' /"), '', scene, fault)
    if (.not. allocated(fault)) call run_scene(scene, run_options_type(quiet=.true., &
      & files=.false.), fault, answer=answer)
    if (.not. allocated(fault)) call answer%get_field('displacement', u, fault)
    if (.not. allocated(fault)) call answer%get_field('stress', stress, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    allocate (at(2), source=0.0_wp)
    do i = 1, 2
      n = 0
      associate (x => answer%positions)
        at(i) = sum(u(:, 1), mask=abs(abs(x(:, 1)) - 0.5_wp) < 0.051_wp .and. &
          & (x(:, 1) > 0.0_wp .eqv. i == 2))
        n = count(abs(abs(x(:, 1)) - 0.5_wp) < 0.051_wp .and. (x(:, 1) > 0.0_wp .eqv. i == 2))
        at(i) = at(i)/n
      end associate
    end do
    call expect_close(error, (at(2) - at(1))*2.0e11_wp/1.0e6_wp, 1.0_wp, 0.01_wp, 'stretch')
    associate (x => answer%positions)
      call expect_close(error, pack(stress(:, 1), abs(x(:, 1)) < 0.7_wp .and. &
        & abs(x(:, 2) - 0.5_wp) < 0.3_wp)/1.0e6_wp, 1.0_wp, 0.09_wp, 'stress')
    end associate
  end subroutine test_grids

  ! ---------------------------------------------------------------- fracture

  !> All bonds through a plane, stretched to their limit, hold Gc per area: on the coarse side, on
  !> the fine side, and between the grids. Sums over eight spacings stand for integrals.
  subroutine test_toughness(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    real(wp), parameter :: planes(3) = [-0.5_wp, 0.0_wp, 0.5_wp]
    real(wp), parameter :: tolerances(3) = [0.02_wp, 0.05_wp, 0.02_wp]
    integer :: i

    call ready_text(grids(30, "model = 'bond_based' critical_energy_release_rate = 100.0 "// &
      & "critical = 'chapter'", "ratio = 6 volume_correction = 'linear_extended' "// &
      & "surface_correction = 'none'", relaxes), set_up, error)
    if (allocated(error)) return
    do i = 1, size(planes)
      call expect_close(error, held(set_up%system, planes(i))/100, 1.0_wp, tolerances(i), &
        & 'Gc at x = '//text_of(planes(i)))
    end do
  end subroutine test_toughness

  !> What the bonds through the plane at `x` hold at their limits, per area, from the bonds of the
  !> points in the middle third [J/m2].
  real(wp) function held(system, x) result(energy)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: x
    type(bonds_type) :: bonds
    real(wp) :: lower, upper, none(system%body%n_slots, 2)
    integer :: k, j, i

    call allocate_bonds(system%family, bonds)
    energy = 0.0_wp
    none = 0.0_wp
    do k = 1, system%body%n_slots
      if (system%body%point(k) == 0 .or. abs(system%body%x(k, 2) - 0.5_wp) > 1/6.0_wp) cycle
      call system%family%bonds_of(k, bonds)
      do i = 1, bonds%n
        j = bonds%j(i)
        if ((system%body%x(k, 1) - x)*(system%body%x(j, 1) - x) > 0.0_wp) cycle
        call bond_limit(system%model, k, j, lower, upper)
        associate (state => state_of_bond(system%model, none, k, bonds, i), &
          & m => system%model%materials(1))
          ! the point's own part of the bond's energy
          energy = energy + m%q/2*state%Gb*upper**2*bonds%length(i)*bonds%weight(i) &
            & *system%body%volume(k)
        end associate
      end do
    end do
    energy = energy*3
  end function held

  subroutine test_given_stretch(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(bonds_type) :: bonds
    real(wp) :: lower, upper
    integer :: k, i

    call ready_text(grids(8, 'poissons_ratio = 0.2 critical_stretch = 0.01 '// &
      & 'break_in_compression = .true.', '', relaxes), set_up, error)
    if (allocated(error)) return
    associate (system => set_up%system)
      call allocate_bonds(system%family, bonds)
      do k = 1, system%body%n_slots
        call system%family%bonds_of(k, bonds)
        do i = 1, bonds%n
          call bond_limit(system%model, k, int(bonds%j(i)), lower, upper)
          call expect_close(error, [lower, upper], [-0.01_wp, 0.01_wp], 0.0_wp, 'limits')
          if (allocated(error)) return
        end do
      end do
    end associate
  end subroutine test_given_stretch

  ! ---------------------------------------------------------------- steps, layers, refusals

  !> The step of 7.25 is stable, 2/omega of the largest frequency at most, and by no more than a
  !> factor of 3 smaller.
  subroutine test_step(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    type(spectrum_type) :: spectrum
    character(:), allocatable :: text
    integer :: dim

    do dim = 1, 3
      text = clouds(dim, merge(30, 20 - 4*dim, dim == 1), 'poissons_ratio = 0.3', '', '')
      text = text(:index(text, relaxes) - 1)//'&time steps = 1 safety = 1 /'
      call ready_text(text, set_up, error)
      if (allocated(error)) return
      call largest_frequency(set_up%system, 1.0e-3_wp, spectrum)
      associate (most => 2/sqrt(spectrum%squared))
        call expect_true(error, set_up%plan%equation <= most*(1 + 1.0e-3_wp), 'unstable: '// &
          & text_of(set_up%plan%equation/most))
        call expect_true(error, set_up%plan%equation > most/3, 'too short: '// &
          & text_of(set_up%plan%equation/most))
      end associate
    end do
  end subroutine test_step

  !> Three rows of each grid's own spacing.
  subroutine test_layers(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up

    call ready_text(grids(10, 'poissons_ratio = 0.2', '', relaxes// &
      & "&boundary side = 'x_min' body = 'a' displacement_x = 0 /"//line// &
      & "&boundary side = 'x_max' body = 'b' displacement_x = 1e-6 /"), set_up, error)
    if (allocated(error)) return
    associate (body => set_up%system%body)
      call check(error, count(body%layer == 1 .and. body%point > 0), 30, 'coarse layer')
      if (.not. allocated(error)) call check(error, count(body%layer == 2 .and. body%point > 0), &
        & 60, 'fine layer')
      call expect_close(error, pack(body%spacing, body%layer == 2 .and. body%point > 0), 0.05_wp, &
        & 1.0e-15_wp, 'spacing')
    end associate
  end subroutine test_layers

  !> A strip of quadrilaterals, 1 m high: two of 1 x 1 m, then five 0.01 m wide, whose horizon is
  !> 0.3 m. Within 3 m of the left end lie all, within their own horizons the first two.
  subroutine test_facets(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: places(8) = [character(4) :: '0', '1', '2', '2.01', '2.02', &
      & '2.03', '2.04', '2.05']
    type(set_up_type) :: set_up
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault
    character(:), allocatable :: text
    integer :: i

    text = '$MeshFormat'//line//'2.2 0 8'//line//'$EndMeshFormat'//line//'$PhysicalNames'//line// &
      & '2'//line//'1 1 "LEFT"'//line//'2 2 "ALL"'//line//'$EndPhysicalNames'//line//'$Nodes'// &
      & line//'16'//line
    do i = 1, 8
      text = text//to_text(2*i - 1)//' '//places(i)//' 0 0'//line//to_text(2*i)//' '//places(i)// &
        & ' 1 0'//line
    end do
    text = text//'$EndNodes'//line//'$Elements'//line//'8'//line//'1 1 2 1 1 1 2'//line
    do i = 1, 7
      text = text//to_text(i + 1)//' 3 2 2 2 '//to_text(2*i - 1)//' '//to_text(2*i + 1)//' '// &
        & to_text(2*i + 2)//' '//to_text(2*i)//line
    end do
    call write_file('horizons.msh', text//'$EndElements'//line)
    call read_scene_text('&scene dimension = 2 thickness = 1.0 /'//line// &
      & "&body name = 'strip' mesh = 'build/horizons.msh' /"//line// &
      & '&material youngs_modulus = 2e11 density = 8e3 poissons_ratio = 0.2 /'//line// &
      & "&boundary side = 'strip:LEFT' displacement_x = 0 /"//line//relaxes//local// &
      & 'ratio = 3 /', '', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) then
      call test_failed(error, fault%message)
      return
    end if
    associate (moved => set_up%system%motions(1)%slots)
      call check(error, size(moved), 2, 'points moved')
      call expect_close(error, sum(set_up%system%body%x(moved, 1)), 2.0_wp, 1.0e-12_wp, 'places')
    end associate
    scene%horizon%local = .false.
    scene%horizon%ratio = 3.0_wp
    call prepare(scene, set_up, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (.not. allocated(error)) call check(error, size(set_up%system%motions(1)%slots), 7, &
      & 'one horizon moves all')
  end subroutine test_facets

  !> Bodies of two spacings push each other as with one horizon, that of the coarser points, and
  !> with equal and opposite forces; a rigid body pushes each by the horizon that it has.
  subroutine test_contact(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: meet = line//'&time steps = 1 /'//line// &
      & "&contact between = 'a', 'b' distance = 0.12 normals = 'centres' /"//line
    real(wp), allocatable :: own(:, :), single(:, :), coarse(:, :), fine(:, :)

    call forces_of(own_grids('&horizon ratio = 3.015 /'//meet), own)
    call forces_of(own_grids('&horizon length = 0.376875 /'//meet), single)
    if (allocated(error)) return
    call expect_true(error, max_abs(single) > 0.0_wp, 'nothing touches')
    call expect_close(error, own, single, 1.0e-12_wp*max_abs(single), 'forces of contact')
    call expect_close(error, sum(own, 1), [0.0_wp, 0.0_wp], 1.0e-12_wp*max_abs(single), 'sum')
    call forces_of(own_grids('&horizon ratio = 3.015 /'//line//ball), own)
    call forces_of(own_grids('&horizon length = 0.376875 /'//line//ball), coarse)
    call forces_of(own_grids('&horizon length = 0.1884375 /'//line//ball), fine)
    if (allocated(error)) return
    ! points of body 'a' come first
    call expect_close(error, own(:64, :), coarse(:64, :), 1.0e-12_wp*max_abs(coarse), 'coarse')
    call expect_close(error, own(65:, :), fine(65:, :), 1.0e-12_wp*max_abs(fine), 'fine')
    call expect_true(error, max_abs(own(:64, :)) > 0.0_wp .and. max_abs(own(65:, :)) > 0.0_wp, &
      & 'the ball touches one body alone')

  contains

    !> Forces of contact on all points [N], the second body moved by 0.05 m towards the first, or
    !> both moved towards a ball.
    subroutine forces_of(text, force)
      character(*), intent(in) :: text
      real(wp), allocatable, intent(out) :: force(:, :)
      type(set_up_type), target :: set_up
      type(term_view_type) :: view
      real(wp), allocatable :: density(:, :)
      integer :: k

      call ready_text(text, set_up, error)
      if (allocated(error)) return
      associate (system => set_up%system)
        if (index(text, ball) > 0) then
          system%state%u(:, 2) = -0.05_wp
        else
          where (system%body%body == 2) system%state%u(:, 1) = -0.05_wp
        end if
        allocate (density(system%body%n_slots, 2), source=0.0_wp)
        call view_of(system, 0.0_wp, view)
        call system%terms%search(view)
        call system%terms%add_force(view, density)
        allocate (force(system%body%n_points, 2))
        do k = 1, system%body%n_points
          force(k, :) = density(system%body%slot(k), :)*system%body%volume(system%body%slot(k))
        end do
      end associate
    end subroutine forces_of

  end subroutine test_contact

  !> The forces of `local`, bit for bit, without it; one horizon, where that is given.
  subroutine test_two_spacings(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: own, same, single
    real(wp), allocatable :: u(:, :), force(:, :), expected(:, :)

    call ready_text(own_grids('&horizon ratio = 3.015 /'//line//relaxes), own, error)
    call ready_text(own_grids('&horizon ratio = 3.015 local = .true. /'//line//relaxes), same, &
      & error)
    call ready_text(own_grids('&horizon length = 0.3 /'//line//relaxes), single, error)
    if (allocated(error)) return
    allocate (u(own%system%body%n_slots, 2), source=0.0_wp)
    call shake(own%system%body, some_gradient(1.0e-3_wp), 1.0e-5_wp, 3, u)
    call force_at(own%system, u, force)
    call force_at(same%system, u, expected)
    call expect_true(error, max_abs(expected) > 0.0_wp, 'no force')
    call expect_close(error, force, expected, 0.0_wp, 'with and without local')
    call expect_true(error, own%system%family%rule%ratio > 0.0_wp, 'one horizon')
    call expect_close(error, single%system%family%rule%ratio, 0.0_wp, 0.0_wp, 'own horizons')
    call expect_close(error, single%system%family%rule%delta, 0.3_wp, 1.0e-15_wp, 'the horizon')
  end subroutine test_two_spacings

  subroutine test_refusals(error)
    type(error_type), allocatable, intent(out) :: error
    character(*), parameter :: solid = 'poissons_ratio = 0.2 '

    call expect_fault(error, grids(8, solid, 'length = 0.4', relaxes), &
      & "'local' and 'length' are both given")
    call refuse(grids(8, "poissons_ratio = 0.2 model = 'lps'", '', relaxes), &
      & "&horizon local does not serve model = 'lps'")
    call refuse(grids(8, "model = 'softening' critical_stretch = 0.01 "// &
      & 'peak_stretch = 0.005', '', relaxes), "&horizon local does not serve model = 'softening'")
    call refuse(grids(8, solid, '', relaxes// &
      & "&relaxation solver = 'dynamic_relaxation' density_matrix = 'chapter' /"), &
      & "&horizon local does not serve density_matrix = 'chapter'")
    call refuse(grids(8, solid, "family = 'lattice'", relaxes), &
      & 'bonds join bodies on different grids')

  contains

    !> `instead`: what the message must advise.
    subroutine refuse(text, parts, instead)
      character(*), intent(in) :: text, parts
      character(*), intent(in), optional :: instead

      call refuse_text(error, text, parts)
      if (present(instead)) call refuse_text(error, text, instead)
    end subroutine refuse

  end subroutine test_refusals

end module test_set_up_horizons
