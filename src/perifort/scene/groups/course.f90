!> The keys of a course in time, which temperature changes, boundaries and loads share.
module pd_scene_groups_course
  use pd_base_kinds, only: wp
  use pd_base_text, only: lower_case
  use pd_scene_format_given, only: is_set
  use pd_scene_format_keys, only: keys_type
  implicit none (type, external)
  private
  public :: visit_course, ramp_of, sides, settle_side

  !> Sides of a body.
  character(5), parameter :: sides(6) = [character(5) :: 'x_min', 'x_max', 'y_min', 'y_max', &
    & 'z_min', 'z_max']

contains

  !> Sides may be written in any case of letters; names of a mesh keep theirs.
  pure subroutine settle_side(side)
    ! allow(C072): lower case is as long as before.
    character(*), intent(inout) :: side  !! in lower case on return, if it is one of `sides`
    if (any(sides == lower_case(side))) side = lower_case(side)
  end subroutine settle_side

  !> The course in time of a temperature change, a boundary or a load.
  subroutine visit_course(keys, ramp_time, times, values, subject)
    type(keys_type), intent(inout) :: keys             !! visitor
    real(wp), intent(inout) :: ramp_time               !! length of a ramp from 0 [s]
    real(wp), allocatable, intent(inout) :: times(:)   !! of a table [s]
    real(wp), allocatable, intent(inout) :: values(:)  !! factors at `times` [-]
    character(*), intent(in), optional :: subject      !! what varies, if not all of the group
    character(:), allocatable :: who

    who = ''
    if (present(subject)) who = subject
    call keys%key('ramp_time', ramp_time, 's', who//'grows linearly from 0 during this time', &
      & above=0.0_wp, default='at once; in relaxation 1, the end of the load steps')
    call keys%list('times', times, 's', 'instead of ramp_time: increasing times')
    call keys%list('values', values, '-', 'factors at these times, linear between them')
  end subroutine visit_course

  !> The length of the ramp of a course without a table. In relaxation, where time runs from 0 to 1
  !> over the load steps, one that says nothing is a ramp over all of them.
  pure real(wp) function ramp_of(method, ramp_time) result(length)
    character(*), intent(in) :: method   !! of `&time`
    real(wp), intent(in) :: ramp_time    !! of the group [s]

    length = ramp_time
    if (method == 'relaxation' .and. .not. is_set(ramp_time)) length = 1.0_wp
  end function ramp_of

end module pd_scene_groups_course
