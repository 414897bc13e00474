!> Probes: points whose values are in every row of the history.
module pd_output_report_probes
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type
  use pd_body_generate, only: touch
  use pd_output_fields_check, only: check_names
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_table, only: field_table_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: probe_type, find_probes, probe_columns, probe_row

  !> A probe: the point that is nearest to the place that the scene names.
  type :: probe_type
    character(:), allocatable :: name
    integer(i4) :: slot = 0_i4
    type(output_field_type), allocatable :: fields(:)
  end type probe_type

contains

  !> The nearest point of each probe; ties go to the lowest point number. An error if a probe or the
  !> output names a field that is not in the table.
  subroutine find_probes(scene, table, body, probes, error)
    type(scene_type), intent(in) :: scene
    type(field_table_type), intent(in) :: table
    type(body_type), intent(in) :: body
    type(probe_type), allocatable, intent(out) :: probes(:)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: distance, least
    integer :: p, i, f

    call check_names(scene, table, error)
    if (allocated(error)) return
    allocate (probes(size(scene%probes)))
    do p = 1, size(probes)
      probes(p)%name = trim(scene%probes(p)%name)
      least = huge(least)
      do i = 1, body%n_points
        distance = norm2(body%x(body%slot(i), :) - scene%probes(p)%point(:body%dim))
        ! differences within the tolerance are ties, so that ties do not depend on rounding
        if (distance >= least - touch*body%spacing(body%slot(i))) cycle
        least = distance
        probes(p)%slot = body%slot(i)
      end do
      allocate (probes(p)%fields(size(scene%probes(p)%fields)))
      do f = 1, size(probes(p)%fields)
        probes(p)%fields(f) = table%field(trim(scene%probes(p)%fields(f)))
      end do
    end do
  end subroutine find_probes

  !> The columns of a probe, in the order of `probe_row`.
  pure function probe_columns(probe, dim) result(columns)
    type(probe_type), intent(in) :: probe
    integer, intent(in) :: dim                    !! 1, 2 or 3
    type(column_type), allocatable :: columns(:)
    character(:), allocatable :: suffix
    integer :: f, c

    allocate (columns(0))
    do f = 1, size(probe%fields)
      associate (field => probe%fields(f))
        do c = 1, field%components(dim)
          suffix = field%component_name(c, dim)
          if (suffix /= '') suffix = '_'//suffix
          columns = [columns, column_type(probe%name//'_'//trim(field%name)//suffix, field%unit, &
            & 'probe')]
        end do
      end associate
    end do
  end function probe_columns

  !> What a probe notes of an instant, in the order of `probe_columns`.
  function probe_row(probe, now) result(row)
    type(probe_type), intent(in) :: probe
    type(moment_type), intent(in) :: now
    real(wp), allocatable :: row(:), values(:, :)
    integer :: f

    allocate (row(0))
    do f = 1, size(probe%fields)
      associate (field => probe%fields(f))
        allocate (values(field%components(now%system%body%dim), 1))
        call field%values_at(now, [int(probe%slot)], values)
        row = [row, values(:, 1)]
        deallocate (values)
      end associate
    end do
  end function probe_row

end module pd_output_report_probes
