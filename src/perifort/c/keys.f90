!> A scene that was read from a text, and keys of it that were set since.
module pd_c_keys
  use pd_base_error, only: error_type
  use pd_scene_content_change, only: change_key, find_target, full_name, target_type
  use pd_scene_content_read, only: read_scene_source, read_scene_text
  use pd_scene_content_types, only: scene_type
  use pd_scene_format_source, only: scan_source, source_type, token_type
  implicit none (type, external)
  private
  public :: keyed_scene_type

  !> A key that was set, and the value as it was given.
  type :: change_type
    character(:), allocatable :: key    !! its full name
    character(:), allocatable :: value
  end type change_type

  type :: keyed_scene_type
    type(scene_type) :: scene                             !! as of the last `renew`
    character(:), allocatable, private :: text            !! as it was read
    character(:), allocatable, private :: name            !! of the file
    type(change_type), allocatable, private :: changes(:) !! in the order in which they were made
    logical, private :: waits = .false.                   !! keys were set since the last `renew`
  contains
    procedure :: read => read_keyed
    procedure :: set_key
    procedure :: renew
  end type keyed_scene_type

contains

  !> Read a scene from a text; `name` stands for the file.
  subroutine read_keyed(self, text, name, error)
    class(keyed_scene_type), intent(inout) :: self
    character(*), intent(in) :: text, name
    type(error_type), allocatable, intent(out) :: error

    call read_scene_text(text, name, self%scene, error)
    self%text = text
    self%name = name
    self%changes = [change_type ::]
    self%waits = .false.
  end subroutine read_keyed

  !> Give a key another value. The key must be there; values and rules are checked by `renew`. A key
  !> that is set again gets the new value.
  subroutine set_key(self, key, value, error)
    class(keyed_scene_type), intent(inout) :: self
    character(*), intent(in) :: key       !! `group%key`, `group(2)%key(1)`, as in &study vary
    character(*), intent(in) :: value     !! as in the file; texts need no quotes
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source
    type(target_type) :: target
    type(change_type) :: change
    integer :: i

    call changed_source(self, source, error)
    if (.not. allocated(error)) call find_target(source, key, nowhere(source), target, error)
    if (allocated(error)) return
    change%key = full_name(source, target)
    change%value = value
    do i = 1, size(self%changes)
      if (self%changes(i)%key == change%key) exit
    end do
    if (i > size(self%changes)) self%changes = [self%changes, change]
    self%changes(i) = change
    self%waits = .true.
  end subroutine set_key

  !> Read the scene anew if keys were set since. After an error they still wait.
  subroutine renew(self, error)
    class(keyed_scene_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    type(source_type) :: source
    type(scene_type) :: scene

    if (.not. self%waits) return
    call changed_source(self, source, error)
    if (.not. allocated(error)) call read_scene_source(source, scene, error)
    if (allocated(error)) return
    self%scene = scene
    self%waits = .false.
  end subroutine renew

  !> The text of a scene, scanned, with the keys that were set.
  subroutine changed_source(self, source, error)
    class(keyed_scene_type), intent(in) :: self
    type(source_type), intent(out) :: source
    type(error_type), allocatable, intent(out) :: error
    type(target_type) :: target
    integer :: i

    call scan_source(self%text, self%name, source, error)
    do i = 1, size(self%changes)
      if (allocated(error)) return
      associate (change => self%changes(i))
        call find_target(source, change%key, nowhere(source), target, error)
        if (.not. allocated(error)) call change_key(source, target, &
          & written(change%value, target%kind), nowhere(source), error)
      end associate
    end do
  end subroutine changed_source

  !> A place in a source that no line of its text has: messages then name the file.
  pure type(token_type) function nowhere(source) result(place)
    type(source_type), intent(in) :: source
    place%text = source%file
  end function nowhere

  !> A value as it stands in a file: texts in quotes.
  pure function written(value, kind) result(word)
    character(*), intent(in) :: value
    character(*), intent(in) :: kind   !! of the key
    character(:), allocatable :: word

    word = value
    if (index(kind, 'text') /= 1 .or. len(value) == 0) return
    if (scan(value(1:1), "'""") == 0) word = "'"//value//"'"
  end function written

end module pd_c_keys
