!> The gradient of the displacements at a point, from its intact bonds, and what follows from it.
!>
!> With H = (sum w eta xi^T)(sum w xi xi^T)^-1, w = vc V/|xi|, the deformation gradient is
!> F = 1 + H: exact where displacements are linear in x, at surfaces too. H is kept rather than F,
!> since strains are small beside 1.
module pd_output_fields_gradient
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_base_tensors, only: cofactors, determinant
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_model, only: model_type
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: shared_type, fill_from_gradient, at_slot_from_gradient, from_gradient_interface
  public :: displacement_gradient, strain_of, stress_of, lack_of_stress, components_of

  !> Least determinant of sum w xi xi^T, scaled to a trace of its dimension (1 if no direction is
  !> preferred), with which the gradient is defined. Half a family has 0.1 and more.
  real(wp), parameter :: flat = 1.0e-6_wp

  !> What several fields of one output need, computed by the first of them.
  type :: shared_type
    real(wp), allocatable :: gradient(:, :, :)  !! of the displacements (3, 3, owned points) [-]
    integer :: undefined = 0                    !! points at which it is not defined
  end type shared_type

  abstract interface
    !> Components of a field at one slot.
    subroutine from_gradient_interface(system, k, gradient, values)
      import :: system_type, wp
      implicit none (type, external)
      type(system_type), intent(in) :: system
      integer, intent(in) :: k                    !! slot of the point
      real(wp), intent(in) :: gradient(3, 3)      !! of the displacements, du_i/dx_j [-]
      real(wp), intent(out) :: values(:)          !! (components)
    end subroutine from_gradient_interface
  end interface

contains

  !> The values of all points of a field that the gradient gives.
  subroutine fill_from_gradient(system, shared, of_gradient, values)
    type(system_type), intent(in) :: system
    type(shared_type), intent(inout) :: shared    !! with the gradients on return
    procedure(from_gradient_interface) :: of_gradient
      !! components of the field at a point
    real(wp), intent(out) :: values(:, :)         !! (points, components)
    real(wp), allocatable :: of_point(:)
    integer :: i, k, n

    if (.not. allocated(shared%gradient)) call find_gradients(system, shared)
    values = 0.0_wp
    n = system%body%order%n_owned
    !$omp parallel default(none) shared(system, shared, values, n) private(of_point, i, k)
    allocate (of_point(size(values, 2)))
    !$omp do schedule(static)
    do i = 1, n
      k = system%body%slot(i)
      call of_gradient(system, k, shared%gradient(:, :, i), of_point)
      values(i, :) = of_point
    end do
    !$omp end parallel
  end subroutine fill_from_gradient

  !> The values of one slot.
  subroutine at_slot_from_gradient(system, k, of_gradient, values)
    type(system_type), intent(in) :: system
    integer, intent(in) :: k                      !! slot of a point
    procedure(from_gradient_interface) :: of_gradient
      !! components of the field at a point
    real(wp), intent(out) :: values(:)            !! (components)
    type(bonds_type) :: bonds
    real(wp) :: gradient(3, 3)
    logical :: defined

    call allocate_bonds(system%family, bonds)
    call system%family%bonds_of(k, bonds)
    call displacement_gradient(system%state%u, k, bonds, gradient, defined)
    call of_gradient(system, k, gradient, values)
  end subroutine at_slot_from_gradient

  !> The gradients of all points that the process owns.
  subroutine find_gradients(system, shared)
    type(system_type), intent(in) :: system
    type(shared_type), intent(inout) :: shared
    type(bonds_type) :: bonds
    logical :: defined
    integer :: i, k, n, undefined

    n = system%body%order%n_owned
    allocate (shared%gradient(3, 3, n))
    undefined = 0
    !$omp parallel default(none) shared(system, shared, n) private(bonds, defined, i, k) &
    !$omp reduction(+:undefined)
    call allocate_bonds(system%family, bonds)
    !$omp do schedule(dynamic, 64)
    do i = 1, n
      k = system%body%slot(i)
      call system%family%bonds_of(k, bonds)
      call displacement_gradient(system%state%u, k, bonds, shared%gradient(:, :, i), defined)
      if (.not. defined) undefined = undefined + 1
    end do
    !$omp end parallel
    shared%undefined = undefined
  end subroutine find_gradients

  !> The gradient of the displacements at slot `k`: 0, and not `defined`, where the intact bonds do
  !> not span the space.
  pure subroutine displacement_gradient(u, k, bonds, gradient, defined)
    real(wp), intent(in) :: u(:, :)           !! (n_slots, dim) displacements [m]
    integer, intent(in) :: k                  !! slot
    type(bonds_type), intent(in) :: bonds     !! of slot `k`; broken ones count nothing
    real(wp), intent(out) :: gradient(3, 3)   !! du_i/dx_j, 0 beyond the dimension [-]
    logical, intent(out) :: defined           !! whether the bonds give it
    real(wp) :: moments(3, 3), moved(3, 3), xi(3), eta(3), w, trace
    integer :: i, c, dim

    dim = size(u, 2)
    moments = 0.0_wp
    moved = 0.0_wp
    xi = 0.0_wp
    eta = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      xi(:dim) = bonds%xi(i, :)
      eta(:dim) = u(bonds%j(i), :) - u(k, :)
      w = bonds%weight(i)/bonds%length(i)
      do c = 1, dim
        moments(:, c) = moments(:, c) + w*xi*xi(c)
        moved(:, c) = moved(:, c) + w*eta*xi(c)
      end do
    end do
    gradient = 0.0_wp
    trace = moments(1, 1) + moments(2, 2) + moments(3, 3)
    defined = trace > 0.0_wp
    if (.not. defined) return
    moments = moments*(dim/trace)
    moved = moved*(dim/trace)
    do c = dim + 1, 3
      moments(c, c) = 1.0_wp
    end do
    defined = determinant(moments) > flat
    if (defined) gradient = matmul(moved, cofactors(moments))/determinant(moments)
  end subroutine displacement_gradient

  !> The strain of Green and Lagrange, (F^T F - 1)/2 with F = 1 + `gradient`, without cancellation.
  pure function strain_of(gradient) result(strain)
    real(wp), intent(in) :: gradient(3, 3)  !! of the displacements [-]
    real(wp) :: strain(3, 3)
    strain = (gradient + transpose(gradient) + matmul(transpose(gradient), gradient))/2
  end function strain_of

  !> The Cauchy stress F S F^T/det F of slot `k`, S the moduli times the mechanical strain: that of
  !> Green and Lagrange less thermal expansion. Thickness and cross section stay those of the start.
  !> 0 at a point that is turned inside out.
  pure function stress_of(model, k, gradient) result(stress)
    type(model_type), intent(in) :: model   !! with its laws
    integer, intent(in) :: k                !! slot
    real(wp), intent(in) :: gradient(3, 3)  !! of the displacements [-]
    real(wp) :: stress(3, 3)                !! in the plane with zz, which is 0 in plane stress [Pa]
    real(wp) :: strain(3, 3), F(3, 3), swelling, volumetric, jacobian
    integer :: c

    strain = strain_of(gradient)
    swelling = 0.0_wp
    if (model%thermal) swelling = model%expansion(k)
    do c = 1, model%dim
      strain(c, c) = strain(c, c) - swelling
    end do
    volumetric = strain(1, 1) + strain(2, 2) + strain(3, 3)
    associate (m => model%materials(model%material(k)))
      stress = 2*m%shear_modulus*strain
      select case (model%dim)
      case (3)
        volumetric = (m%bulk_modulus - 2*m%shear_modulus/3)*volumetric
      case (2)
        volumetric = (m%bulk_modulus - m%shear_modulus)*volumetric
        ! the expansion of plane strain, (1 + nu) alpha dT, leaves this of the third direction
        if (in_plane_strain(model, k)) stress(3, 3) = volumetric - 2*m%shear_modulus*swelling
      case (1)
        stress = 0.0_wp
        volumetric = m%youngs_modulus*volumetric
      case default
        call internal_fault('stress_of knows one to three dimensions')
      end select
    end associate
    F = gradient
    do c = 1, 3
      if (c <= model%dim) stress(c, c) = stress(c, c) + volumetric
      F(c, c) = F(c, c) + 1
    end do
    jacobian = determinant(F)
    if (jacobian <= 0.0_wp) then
      stress = 0.0_wp
    else
      stress = matmul(F, matmul(stress, transpose(F)))/jacobian
    end if
  end function stress_of

  !> Whether the material of slot `k` is in plane strain.
  pure logical function in_plane_strain(model, k)
    type(model_type), intent(in) :: model
    integer, intent(in) :: k

    in_plane_strain = .false.
    if (.not. allocated(model%laws)) call internal_fault('a stress of materials without laws')
    in_plane_strain = model%laws(model%material(k))%law%plane_strain
  end function in_plane_strain

  !> Why a system has no stress of its strain, '' if it has: a law with a history has a stress that
  !> does not follow from the strain.
  function lack_of_stress(system) result(reason)
    type(system_type), intent(in) :: system
    character(:), allocatable :: reason
    integer :: m

    reason = ''
    associate (model => system%model)
      do m = 1, size(model%materials)
        if (.not. any(model%material == m .and. system%body%point > 0)) cycle
        associate (law => model%laws(m)%law)
          if (law%bond_history + law%point_history == 0) cycle
          reason = "the stress of model '"//trim(law%name)//"' depends on its history, not on "// &
            & "the strain alone; 'bond_stress' is the stress of its forces"
          return
        end associate
      end do
    end associate
  end function lack_of_stress

  !> The components of a symmetric tensor in the order of the output: xx, yy, zz, xy, yz, xz; with
  !> `with_zz` also in the plane.
  pure subroutine components_of(tensor, dim, with_zz, values)
    real(wp), intent(in) :: tensor(3, 3)  !! symmetric
    integer, intent(in) :: dim            !! 1, 2 or 3
    logical, intent(in) :: with_zz        !! has zz in the plane
    real(wp), intent(out) :: values(:)    !! (components)

    values(1) = tensor(1, 1)
    if (dim == 1) return
    values(2) = tensor(2, 2)
    values(size(values)) = tensor(1, 2)
    if (dim == 3 .or. with_zz) values(3) = tensor(3, 3)
    if (dim == 3) values(4:) = [tensor(1, 2), tensor(2, 3), tensor(1, 3)]
  end subroutine components_of

end module pd_output_fields_gradient
