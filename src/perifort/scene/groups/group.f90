!> Base type of every namelist group of a scene: its keys can be visited.
module pd_scene_groups_group
  use pd_scene_format_keys, only: keys_type
  implicit none (type, external)
  private
  public :: group_type, change_refused, change_harmless, change_of_the_end, change_of_the_files

  !> Effect of a changed key on a run that is restarted from a checkpoint.
  enum, bind(c)
    enumerator :: change_refused       !! another problem: the run cannot go on
    enumerator :: change_harmless      !! the results that are there stay right
    enumerator :: change_of_the_end    !! the run may end at another step
    enumerator :: change_of_the_files  !! the results get another form
  end enum

  !> One group. Its components are its keys, each with its default.
  type, abstract :: group_type
  contains
    procedure(visit_interface), deferred :: visit  !! read, describe or write its keys
    procedure, nopass :: change_of                 !! what the change of a key means to a restart
  end type group_type

  abstract interface
    !> Show all keys to the visitor, in the order in which the reference lists them.
    subroutine visit_interface(group, keys)
      import :: group_type, keys_type
      implicit none (type, external)
      class(group_type), intent(inout) :: group  !! its components are read or shown
      type(keys_type), intent(inout) :: keys     !! the visitor: reads, describes, writes
    end subroutine visit_interface
  end interface

contains

  !> A change makes another problem, unless the group says otherwise.
  pure integer function change_of(key) result(change)
    character(*), intent(in) :: key        !! its name, '' for the group as a whole

    associate (unused_key => key)
    end associate
    change = change_refused
  end function change_of

end module pd_scene_groups_group
