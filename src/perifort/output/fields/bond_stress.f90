!> The field `bond_stress`.
module pd_output_fields_bond_stress
  use pd_base_kinds, only: wp
  use pd_family_family, only: bonds_type, allocate_bonds
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type, output_field_type, rank_symmetric
  use pd_output_fields_gradient, only: components_of
  use pd_output_fields_pair_force, only: pair_force
  implicit none (type, external)
  private
  public :: bond_stress_field

contains

  !> Its description.
  type(output_field_type) function bond_stress_field() result(field)
    field%name = 'bond_stress'
    field%unit = 'Pa'
    field%meaning = 'stress of the bond forces: symmetric part of half the sum of force times bond'
    field%rank = rank_symmetric
    field%fill => fill
    field%at_slot => at_slot
  end function bond_stress_field

  subroutine fill(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    type(system_type), pointer :: system
    type(bonds_type) :: bonds
    real(wp), allocatable :: of_point(:)
    integer :: i, k, n

    system => now%system
    values = 0.0_wp
    n = system%body%order%n_owned
    !$omp parallel default(none) shared(system, values, n) private(bonds, of_point, i, k)
    call allocate_bonds(system%family, bonds)
    allocate (of_point(size(values, 2)))
    !$omp do schedule(dynamic, 64)
    do i = 1, n
      k = system%body%slot(i)
      call system%family%bonds_of(k, bonds)
      call components_of(stress_of_bonds(system, k, bonds), system%body%dim, .false., of_point)
      values(i, :) = of_point
    end do
    !$omp end parallel
  end subroutine fill

  subroutine at_slot(now, k, values)
    type(moment_type), intent(in) :: now
    integer, intent(in) :: k
    real(wp), intent(out) :: values(:)
    type(bonds_type) :: bonds

    associate (system => now%system)
      call allocate_bonds(system%family, bonds)
      call system%family%bonds_of(k, bonds)
      call components_of(stress_of_bonds(system, k, bonds), system%body%dim, .false., values)
    end associate
  end subroutine at_slot

  !> (1/2) sum f xi^T vc V over the intact bonds of slot `k`, its symmetric part: f is the pair
  !> force density of the present forces, xi the undeformed bond.
  pure function stress_of_bonds(system, k, bonds) result(stress)
    type(system_type), intent(in) :: system  !! with forces that are up to date
    integer, intent(in) :: k
    type(bonds_type), intent(in) :: bonds
    real(wp) :: stress(3, 3)
    real(wp) :: magnitude, direction(3)
    integer :: i, c

    stress = 0.0_wp
    do i = 1, bonds%n
      if (.not. bonds%intact(i)) cycle
      call pair_force(system, k, bonds, i, magnitude, direction)
      do c = 1, system%model%dim
        stress(:, c) = stress(:, c) + magnitude*bonds%weight(i)*direction*bonds%xi(i, c)/2
      end do
    end do
    stress = (stress + transpose(stress))/2
  end function stress_of_bonds

end module pd_output_fields_bond_stress
