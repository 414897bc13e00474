!> The tangent of the forces against the linearised theory written out bond by bond, and against the
!> energy where the body is deformed.
module test_motion_tangent
  use pd_base_kinds, only: wp
  use pd_set_up_prepare, only: set_up_type
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_force_forces, only: energy_pass
  use pd_motion_system, only: system_type
  use pd_motion_tangent, only: apply_tangent
  use pd_scene_content_types, only: scene_type
  use comparisons, only: expect_close, max_abs
  use testdrive, only: error_type, new_unittest, unittest_type
  use bodies, only: box_scene, expect, ready, shake, text_of
  implicit none (type, external)
  private
  public :: collect_motion_tangent

  real(wp), parameter :: spacing = 1.0e-2_wp
  real(wp), parameter :: no_gradient(3, 3) = 0.0_wp

contains

  subroutine collect_motion_tangent(testsuite)
    type(unittest_type), allocatable, intent(out) :: testsuite(:)
    testsuite = [ &
      & new_unittest('undeformed: the linearised theory, bond by bond', test_undeformed), &
      & new_unittest('deformed: the curvature of the energy', test_curvature), &
      & new_unittest('deformed: symmetric in the inner product of volumes', test_symmetry), &
      & new_unittest('continuous where the deformation vanishes', test_continuous), &
      & new_unittest('deformed: the same in mixed precision', test_mixed)]
  end subroutine collect_motion_tangent

  !> A bar, a plate and a block with a dilatation, with surface factors, in both families.
  subroutine body_number(number, set_up, name, error, warm)
    integer, intent(in) :: number
    type(set_up_type), intent(out) :: set_up
    character(:), allocatable, intent(out) :: name
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in), optional :: warm
    type(scene_type) :: scene
    character(7), parameter :: families(2) = [character(7) :: 'lattice', 'list']

    select case ((number + 1)/2)
    case (1); call box_scene([12], spacing, 0.3_wp, scene)
    case (2); call box_scene([9, 8], spacing, 0.42_wp, scene)
    case default; call box_scene([6, 5, 5], spacing, 0.1_wp, scene)
    end select
    scene%horizon%surface_correction = 'energy'
    ! the tangent takes the other one
    scene%horizon%dilatation = 'projected'
    scene%horizon%family = families(mod(number, 2) + 1)
    if (present(warm)) then
      scene%materials%thermal_expansion = 1.0e-5_wp
      deallocate (scene%initial)
      allocate (scene%initial(1))
      scene%initial(1)%temperature_change = 100.0_wp
    end if
    name = text_of(real(scene%header%dimension, wp))//' dimensions, '//trim(scene%horizon%family)
    call ready(scene, set_up, error)
  end subroutine body_number

  !> To some ten times the rounding of a sum of a hundred bonds: nothing but rounding is lost.
  subroutine test_undeformed(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    character(:), allocatable :: name
    real(wp), allocatable :: w(:, :), kw(:, :), expected(:, :)
    integer :: number

    do number = 1, 6
      call body_number(number, set_up, name, error)
      if (allocated(error)) return
      allocate (w, mold=set_up%system%state%u)
      allocate (kw, expected, mold=w)
      call shake(set_up%system%body, no_gradient, 1.0_wp, 7 + number, w)
      call linear_theory(set_up%system, w, expected)
      call apply_tangent(set_up%system, 0*w, w, kw)
      call expect(error, max_abs(kw - expected)/max_abs(expected), 0.0_wp, 1.0e-13_wp, name)
      ! the size of the direction doesn't matter: 1e-30 m, or a light year
      call apply_tangent(set_up%system, 0*w, 1.0e-30_wp*w, kw)
      call expect(error, max_abs(1.0e30_wp*kw - expected)/max_abs(expected), 0.0_wp, &
        & 1.0e-13_wp, name//', tiny direction')
      call apply_tangent(set_up%system, 0*w, 1.0e16_wp*w, kw)
      call expect(error, max_abs(1.0e-16_wp*kw - expected)/max_abs(expected), 0.0_wp, &
        & 1.0e-13_wp, name//', huge direction')
      call apply_tangent(set_up%system, 0*w, 0*w, kw)
      call expect_close(error, kw, 0.0_wp, 0.0_wp, name//', no direction')
      deallocate (w, kw, expected)
    end do
  end subroutine test_undeformed

  !> -f of the linearised 7.37 to 7.39 (doc/theory.md, 2): s = n.eta/|xi|, Lambda = 1.
  subroutine linear_theory(system, w, kw)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: w(:, :)
    real(wp), intent(out) :: kw(:, :)
    type(bonds_type) :: bonds
    real(wp) :: p(size(w, 1)), n(size(w, 2)), s
    integer :: pass, k, i

    p = 0.0_wp
    kw = 0.0_wp
    call allocate_bonds(system%family, bonds)
    associate (model => system%model)
      do pass = 1, 2
        do k = 1, size(w, 1)
          if (system%body%point(k) == 0) cycle
          call system%family%bonds_of(k, bonds)
          do i = 1, bonds%n
            associate (j => bonds%j(i), length => bonds%length(i), m => model%materials(1))
              n = bonds%xi(i, :)/length
              s = dot_product(n, w(j, :) - w(k, :))/length
              if (pass == 1) then
                p(k) = p(k) + m%p*m%t*joined(n, model%D(k, :), model%D(j, :))*s*bonds%weight(i)
              else
                kw(k, :) = kw(k, :) - ((p(k) + p(j))*joined(n, model%D(k, :), model%D(j, :)) &
                  & /length + 2*m%q*joined(n, model%S(k, :), model%S(j, :))*s)*n*bonds%weight(i)
              end if
            end associate
          end do
        end do
      end do
    end associate
  end subroutine linear_theory

  !> The surface factor of a bond along n (doc/theory.md, 4).
  pure real(wp) function joined(n, own, other)
    real(wp), intent(in) :: n(:), own(:), other(:)
    joined = 1/sqrt(sum((2*n/(own + other))**2))
  end function joined

  !> w.V K w is the second derivative of the strain energy along w, for a body that is strained by
  !> a tenth, sheared, turned and warm. The difference quotient of the energy is good to h^2 = 1e-6
  !> of it and to rounding over h^2.
  subroutine test_curvature(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    character(:), allocatable :: name
    real(wp), allocatable :: u(:, :), w(:, :), kw(:, :)
    real(wp) :: curvature
    real(wp), parameter :: h = 1.0e-3_wp
    integer :: number, c

    do number = 1, 6
      call body_number(number, set_up, name, error, warm=.true.)
      if (allocated(error)) return
      set_up%system%model%projected = .false.
      allocate (u, mold=set_up%system%state%u)
      allocate (w, kw, mold=u)
      call shake(set_up%system%body, strained(), 0.02_wp*spacing, number, u)
      call shake(set_up%system%body, no_gradient, spacing, 40 + number, w)
      call apply_tangent(set_up%system, u, w, kw)
      curvature = (energy(set_up%system, u + h*w) - 2*energy(set_up%system, u) &
        & + energy(set_up%system, u - h*w))/h**2
      do c = 1, size(w, 2)
        kw(:, c) = kw(:, c)*set_up%system%body%volume
      end do
      call expect(error, sum(w*kw)/curvature, 1.0_wp, 1.0e-5_wp, name)
      deallocate (u, w, kw)
    end do
  end subroutine test_curvature

  !> A deformation of every kind.
  pure function strained() result(gradient)
    real(wp) :: gradient(3, 3)
    gradient = reshape([0.1_wp, 0.2_wp, 0.0_wp, -0.3_wp, -0.05_wp, 0.1_wp, 0.0_wp, -0.1_wp, &
      & 0.03_wp], [3, 3])
  end function strained

  !> Strain energy [J].
  real(wp) function energy(system, u)
    type(system_type), intent(inout) :: system
    real(wp), intent(in), contiguous :: u(:, :)
    real(wp) :: density(size(u, 1))

    call energy_pass(system%family, system%model, system%workspace, u, density)
    energy = dot_product(density, system%body%volume)
  end function energy

  !> (a, K b) = (b, K a), though the model is the projected one: to the error of the differences,
  !> some 1e-10 of K.
  subroutine test_symmetry(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    character(:), allocatable :: name
    real(wp), allocatable :: u(:, :), a(:, :), b(:, :), ka(:, :), kb(:, :)
    integer :: number, c

    do number = 1, 6
      call body_number(number, set_up, name, error)
      if (allocated(error)) return
      allocate (u, mold=set_up%system%state%u)
      allocate (a, b, ka, kb, mold=u)
      call shake(set_up%system%body, strained(), 0.02_wp*spacing, number, u)
      call shake(set_up%system%body, no_gradient, 1.0_wp, 50 + number, a)
      call shake(set_up%system%body, no_gradient, 1.0_wp, 60 + number, b)
      call apply_tangent(set_up%system, u, a, ka)
      call apply_tangent(set_up%system, u, b, kb)
      do c = 1, size(a, 2)
        ka(:, c) = ka(:, c)*set_up%system%body%volume
        kb(:, c) = kb(:, c)*set_up%system%body%volume
      end do
      call expect(error, (sum(b*ka) - sum(a*kb))/sqrt(sum(a*ka)*sum(b*kb)), 0.0_wp, 1.0e-9_wp, name)
      deallocate (u, a, b, ka, kb)
    end do
  end subroutine test_symmetry

  !> Of a strain of 1e-9 the central differences must see no more than that.
  subroutine test_continuous(error)
    type(error_type), allocatable, intent(out) :: error
    type(set_up_type) :: set_up
    character(:), allocatable :: name
    real(wp), allocatable :: u(:, :), w(:, :), here(:, :), there(:, :)
    integer :: number

    do number = 1, 6
      call body_number(number, set_up, name, error)
      if (allocated(error)) return
      allocate (u, mold=set_up%system%state%u)
      allocate (w, here, there, mold=u)
      call shake(set_up%system%body, 1.0e-9_wp*strained(), 0.0_wp, 1, u)
      call shake(set_up%system%body, no_gradient, 1.0_wp, 70 + number, w)
      call apply_tangent(set_up%system, 0*w, w, here)
      call apply_tangent(set_up%system, u, w, there)
      call expect(error, max_abs(here - there)/max_abs(here), 0.0_wp, 1.0e-8_wp, name)
      deallocate (u, w, here, there)
    end do
  end subroutine test_continuous

  !> A deformed body's tangent is a difference of forces, for which bonds in single precision have
  !> too few digits. In mixed precision it is that of double precision, but for weights rounded to
  !> 6e-8.
  subroutine test_mixed(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    real(wp), allocatable :: u(:, :), w(:, :), kw(:, :), expected(:)
    real(wp) :: poissons_ratio
    integer :: dim, way, precision

    do dim = 2, 3
      do way = 1, 3
        do precision = 1, 2
          ! a = 0; a dilatation of either kind
          poissons_ratio = merge(merge(0.25_wp, 1.0_wp/3, dim == 3), 0.4_wp, way == 1)
          call box_scene(spread(6, 1, dim), spacing, poissons_ratio, scene)
          scene%header%precision = merge('mixed ', 'double', precision == 2)
          if (way == 2) scene%horizon%dilatation = 'projected'
          call ready(scene, set_up, error)
          if (allocated(error)) return
          if (allocated(u)) deallocate (u, w, kw)
          allocate (u, w, kw, mold=set_up%system%state%u)
          call shake(set_up%system%body, reshape([1.0_wp, 0.3_wp, 0.2_wp, -0.4_wp, 0.5_wp, 0.1_wp, &
            & 0.6_wp, -0.7_wp, 0.8_wp], [3, 3])*1.0e-3_wp, 1.0e-4_wp*spacing, 91, u)
          call shake(set_up%system%body, no_gradient, 1.0_wp, 92, w)
          call apply_tangent(set_up%system, u, w, kw)
          if (precision == 1) then
            expected = gather(set_up%system, kw)
          else
            call expect(error, max_abs(gather(set_up%system, kw) - expected) &
              & /max_abs(expected), 0.0_wp, 1.0e-6_wp, text_of(real(dim, wp))// &
              & ' dimensions, way '//text_of(real(way, wp)))
          end if
        end do
      end do
    end do
  end subroutine test_mixed

  !> Values of slots, point by point: blocks in mixed precision are longer, and rows of slots with
  !> them.
  pure function gather(system, values) result(ordered)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: values(:, :)
    real(wp), allocatable :: ordered(:)

    ordered = reshape(values(system%body%slot, :), [system%body%n_points*size(values, 2)])
  end function gather

end module test_motion_tangent
