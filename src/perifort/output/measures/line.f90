!> Lines: profiles of fields at equidistant positions, at each output.
module pd_output_measures_line
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use pd_body_body, only: body_type
  use pd_output_fields_between, only: choose_ranks, find_spots, spots_type, values_at_spots
  use pd_output_fields_field, only: moment_type, output_field_type
  use pd_output_fields_table, only: field_table_type
  use pd_output_measures_probe, only: nearest_slots
  use pd_output_results_results, only: results_type
  use pd_output_results_types, only: line_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: profile_type, profiles_of, write_profiles

  !> A line of a scene.
  type :: profile_type
    type(line_type) :: line                      !! how the results hold it
    integer, allocatable :: nearest(:)           !! slot of the nearest owned point to each position
    logical, allocatable :: here(:)              !! of all ranks this one has the nearest
    type(output_field_type), allocatable :: fields(:)
  end type profile_type

contains

  !> The lines of a scene at the points of its body.
  subroutine profiles_of(scene, table, body, profiles)
    type(scene_type), intent(in) :: scene                      !! a checked scene
    type(field_table_type), intent(in) :: table                !! of its fields
    type(body_type), intent(in) :: body                        !! of the scene
    type(profile_type), allocatable, intent(out) :: profiles(:)
    real(wp) :: place(3)
    integer :: i, p, f, c, d

    d = body%dim
    allocate (profiles(size(scene%lines)))
    do i = 1, size(profiles)
      associate (group => scene%lines(i), line => profiles(i)%line)
        line%name = group%name
        allocate (line%positions(group%points, d))
        allocate (line%fields(size(group%fields)), profiles(i)%fields(size(group%fields)))
        do p = 1, group%points
          place = 0.0_wp
          place(:d) = group%from(:d) + (group%to(:d) - group%from(:d)) &
            & *(real(p - 1, wp)/real(group%points - 1, wp))
          line%positions(p, :) = place(:d)
        end do
        profiles(i)%nearest = nearest_slots(body, line%positions)
        call choose_ranks(body, profiles(i)%nearest, line%positions, profiles(i)%here)
        do f = 1, size(group%fields)
          profiles(i)%fields(f) = table%field(trim(group%fields(f)))
          associate (field => profiles(i)%fields(f), entry => line%fields(f))
            entry%name = field%name
            entry%unit = field%unit
            entry%components = field%components(d)
            do c = 1, entry%components
              entry%labels = trim(entry%labels)//' '//field%component_name(c, d)
            end do
            entry%labels = adjustl(entry%labels)
          end associate
        end do
      end associate
    end do
  end subroutine profiles_of

  !> Give the profiles of an output that has begun to the results. Positions outside of the bodies
  !> have NaN.
  subroutine write_profiles(results, profiles, now, error)
    type(results_type), intent(inout) :: results       !! was created with these lines
    type(profile_type), intent(in) :: profiles(:)
    type(moment_type), intent(in) :: now
    type(error_type), allocatable, intent(out) :: error
    type(spots_type) :: spots
    real(wp), allocatable :: values(:, :), table(:, :)
    integer :: i, p, f, first, n

    do i = 1, size(profiles)
      associate (line => profiles(i)%line, nearest => profiles(i)%nearest)
        call find_spots(now%system, nearest, profiles(i)%here, line%positions, spots)
        allocate (table(sum(line%fields%components), size(nearest)))
        first = 1
        do f = 1, size(line%fields)
          n = line%fields(f)%components
          allocate (values(n, size(nearest)))
          call values_at_spots(profiles(i)%fields(f), now, spots, values)
          table(first:first + n - 1, :) = values
          first = first + n
          deallocate (values)
        end do
        do p = 1, size(nearest)
          if (.not. spots%inside(p)) table(:, p) = ieee_value(1.0_wp, ieee_quiet_nan)
        end do
        call results%put_line(i, table, error)
        deallocate (table)
      end associate
      if (allocated(error)) return
    end do
  end subroutine write_profiles

end module pd_output_measures_line
