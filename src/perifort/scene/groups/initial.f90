!> The group `&initial`: the state at the start.
module pd_scene_groups_initial
  use pd_base_kinds, only: wp
  use pd_scene_format_given, only: name_length, path_length, text_length, unset
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_course, only: visit_course
  use pd_scene_groups_group, only: group_type
  implicit none (type, external)
  private
  public :: initial_group

  !> `&initial`
  type, extends(group_type) :: initial_group
    character(name_length) :: region = ''        !! '' = all points
    real(wp) :: displacement(3) = unset          !! displacement_x, _y, _z [m]
    real(wp) :: velocity(3) = unset              !! velocity_x, _y, _z [m/s]
    character(text_length) :: displacement_text(3) = ''  !! instead: expressions of x, y, z
    character(text_length) :: velocity_text(3) = ''
    real(wp) :: displacement_gradient(3, 3) = 0.0_wp  !! H(i,j) = du_i/dx_j [-]
    real(wp) :: velocity_gradient(3, 3) = 0.0_wp      !! [1/s]
    real(wp) :: temperature_change = unset       !! [K]
    character(text_length) :: temperature_text = ''  !! instead: an expression of x, y, z, t
    real(wp) :: ramp_time = unset                !! of the temperature change [s]
    real(wp), allocatable :: times(:)            !! of the temperature change [s]
    real(wp), allocatable :: values(:)           !! factors at `times` [-]
    character(path_length) :: file = ''          !! a table of columns, a row per point
  contains
    procedure :: visit
  end type initial_group

contains

  !> The keys of the group.
  subroutine visit(group, keys)
    class(initial_group), intent(inout) :: group  !! its components are read or shown
    type(keys_type), intent(inout) :: keys        !! the visitor: reads, describes, writes

    call keys%key('region', group%region, 'name of a region', default='all points')
    call keys%triple('displacement', group%displacement, 'm', 'displacement', '0', &
      & group%displacement_text)
    call keys%triple('velocity', group%velocity, 'm/s', 'velocity', '0', group%velocity_text)
    call keys%key('displacement_gradient', group%displacement_gradient, '-', &
      & 'H(i,j) = du_i/dx_j: adds H x to the displacement')
    call keys%key('velocity_gradient', group%velocity_gradient, '1/s', &
      & 'G(i,j) = dv_i/dx_j: adds G x to the velocity')
    call keys%key('temperature_change', group%temperature_change, 'K', 'temperature change', &
      & default='0', text=group%temperature_text)
    call visit_course(keys, group%ramp_time, group%times, group%values, 'the temperature change ')
    call keys%key('file', group%file, 'a table with a header that names columns among '// &
      & 'displacement_x.., velocity_x.., temperature_change, and a row per point')
  end subroutine visit

end module pd_scene_groups_initial
