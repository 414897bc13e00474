!> A scene that was built or changed in memory: completed, and held to every rule that a scene file
!> must keep.
module pd_scene_content_complete
  use pd_base_error, only: error_type
  use pd_scene_content_read, only: read_scene_source
  use pd_scene_content_types, only: scene_type, name_length
  use pd_scene_content_write, only: scene_text
  use pd_scene_format_source, only: scan_source, source_type
  implicit none (type, external)
  private
  public :: complete_scene

contains

  !> Check a scene and complete it: afterwards every list is allocated, and every value that goes
  !> without saying is there. Nothing needs to be allocated before, and a complete scene stays as it
  !> is.
  !>
  !> The scene is written as text and read back, bit for bit: words, ranges and rules are those of a
  !> scene file, from one place. Errors name the group and the key, since the text is of no file.
  !> Lists of fields of size 0 mean no fields and stay so.
  subroutine complete_scene(scene, error)
    type(scene_type), intent(inout) :: scene             !! lists of size 0 or none: no groups
    type(error_type), allocatable, intent(out) :: error  !! the broken rule; then it is as it was
    type(scene_type) :: complete
    type(source_type) :: source
    character(:), allocatable :: file
    integer :: i

    file = ''
    if (allocated(scene%file)) file = scene%file
    call scan_source(scene_text(scene), file, source, error, in_memory=.true.)
    if (.not. allocated(error)) call read_scene_source(source, complete, error, &
      & scene%table, scene%laws)
    if (allocated(error)) return
    if (allocated(scene%text)) complete%text = scene%text
    if (allocated(scene%changes)) complete%changes = scene%changes
    if (is_empty(scene%output%fields)) complete%output%fields = scene%output%fields
    do i = 1, size(complete%probes)
      if (is_empty(scene%probes(i)%fields)) complete%probes(i)%fields = scene%probes(i)%fields
    end do
    scene = complete
  end subroutine complete_scene

  !> Whether a list is there and has nothing in it.
  pure logical function is_empty(list)
    character(name_length), allocatable, intent(in) :: list(:)

    is_empty = .false.
    if (allocated(list)) is_empty = size(list) == 0
  end function is_empty

end module pd_scene_content_complete
