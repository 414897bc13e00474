!> Fields of the output that tests add to the table, of points that fly at one velocity v.
module own_fields
  use pd_base_kinds, only: wp
  use pd_motion_system, only: system_type
  use pd_output_fields_field, only: moment_type, output_field_type, rank_symmetric
  implicit none (type, external)
  private
  public :: motion_energy_field, momentum_flux_field, never_field

contains

  !> Kinetic energy density rho v.v/2, of a point alone too.
  type(output_field_type) function motion_energy_field() result(field)
    field%name = 'motion_energy'
    field%unit = 'J/m3'
    field%meaning = 'kinetic energy density'
    field%fill => fill_energy
    field%at_slot => energy_at
  end function motion_energy_field

  subroutine fill_energy(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    integer :: i

    do i = 1, size(values, 1)
      call energy_at(now, int(now%system%body%slot(i)), values(i, :))
    end do
  end subroutine fill_energy

  subroutine energy_at(now, k, values)
    type(moment_type), intent(in) :: now
    integer, intent(in) :: k
    real(wp), intent(out) :: values(:)

    associate (m => now%system%model)
      values = m%materials(m%material(k))%density*sum(now%v(k, :)**2)/2
    end associate
  end subroutine energy_at

  !> Flux of momentum rho v v, for all points at once only.
  type(output_field_type) function momentum_flux_field() result(field)
    field%name = 'momentum_flux'
    field%unit = 'Pa'
    field%meaning = 'flux of momentum'
    field%rank = rank_symmetric
    field%fill => fill_flux
  end function momentum_flux_field

  subroutine fill_flux(now, values)
    type(moment_type), intent(in) :: now
    real(wp), intent(out) :: values(:, :)
    integer :: i, k

    associate (m => now%system%model)
      do i = 1, size(values, 1)
        k = now%system%body%slot(i)
        values(i, :) = m%materials(m%material(k))%density*products(now%v(k, :))
      end do
    end associate
  end subroutine fill_flux

  !> The products of two components: xx, yy, zz, xy, yz, xz, as far as the dimension has them.
  pure function products(v)
    real(wp), intent(in) :: v(:)
    real(wp), allocatable :: products(:)

    products = v**2
    if (size(v) == 2) products = [products, v(1)*v(2)]
    if (size(v) == 3) products = [products, v(1)*v(2), v(2)*v(3), v(1)*v(3)]
  end function products

  !> A field that a body whose bonds cannot break does not have.
  type(output_field_type) function never_field() result(field)
    field%name = 'age_of_cracks'
    field%unit = 's'
    field%meaning = 'time since the last bond broke'
    field%fill => fill_energy
    field%lack => lack
  end function never_field

  function lack(system) result(reason)
    type(system_type), intent(in) :: system
    character(:), allocatable :: reason
    reason = ''
    if (.not. system%model%breaking) reason = 'no bond can break'
  end function lack

end module own_fields
