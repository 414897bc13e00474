!> One output: the fields that a run writes, computed now and given to the results.
module pd_output_fields_write
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use pd_output_deal, only: deal_type
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_gradient, only: shared_type
  use pd_output_results_results, only: results_type
  use pd_output_results_types, only: field_type
  implicit none (type, external)
  private
  public :: write_fields

contains

  !> Write all fields of an output that has begun. `undefined` is the number of points at which the
  !> gradient of the displacements is not defined, 0 if no field needs it.
  subroutine write_fields(results, deal, fields, now, undefined, error)
    type(results_type), intent(inout) :: results        !! was created with these fields
    type(deal_type), intent(in) :: deal                 !! of values to the ranks that write them
    type(output_field_type), intent(in) :: fields(:)
    type(moment_type), intent(in) :: now
    integer, intent(out) :: undefined
    type(error_type), allocatable, intent(out) :: error
    type(shared_type), target :: shared
    type(moment_type) :: moment
    type(field_type) :: entry
    real(wp), allocatable :: own(:, :), values(:, :), one(:)
    integer :: f, n, c

    undefined = 0
    moment = now
    moment%shared => shared
    do f = 1, size(fields)
      entry = fields(f)%in_file(now%system%body%dim)
      n = fields(f)%components(now%system%body%dim)
      if (deal%needed) then
        allocate (own(now%system%body%order%n_owned, n), values(deal%rows%n, entry%components))
        call fields(f)%all_values(moment, own)
        do c = 1, n
          call deal%values_of_rows(now%system%body, own(:, c), one)
          values(:, c) = one
        end do
        deallocate (own)
      else
        allocate (values(now%system%body%n_points, entry%components))
        call fields(f)%all_values(moment, values(:, :n))
      end if
      values(:, n + 1:) = 0.0_wp
      if (entry%components == 1) then
        call results%put_field(f, values(:, 1), error)
      else
        call results%put_field(f, values, error)
      end if
      if (allocated(error)) return
      deallocate (values)
    end do
    undefined = shared%undefined
  end subroutine write_fields

end module pd_output_fields_write
