!> The input of a user: a scene, which holds the groups of a scene file, and the table of the groups
!> that there are.
!>
!> The groups themselves are the types in `scene/groups`, every component with its default and unit.
!> Whoever builds a scene without a file fills these types directly.
module pd_scene_content_types
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_law_laws, only: all_laws, law_table_type
  use pd_scene_format_file, only: line_type
  use pd_scene_format_given, only: is_given, is_set, name_length, path_length, &
    & text_length, unset
  use pd_scene_format_keys, only: keys_type, mode_describe
  use pd_scene_groups_body, only: body_group, has_cut_cells, has_grid, is_box, is_lattice, &
    & is_turned, words_of_body
  use pd_scene_groups_boundary, only: adds_layer, boundary_group
  use pd_scene_groups_contact, only: contact_group
  use pd_scene_groups_crack, only: crack_group
  use pd_scene_groups_define, only: define_group
  use pd_scene_groups_group, only: group_type
  use pd_scene_groups_header, only: header_type
  use pd_scene_groups_horizon, only: horizon_group
  use pd_scene_groups_initial, only: initial_group
  use pd_scene_groups_j_integral, only: j_integral_group
  use pd_scene_groups_line, only: line_group
  use pd_scene_groups_load, only: load_group
  use pd_scene_groups_material, only: material_group
  use pd_scene_groups_output, only: output_group
  use pd_scene_groups_probe, only: probe_group
  use pd_scene_groups_refine, only: refine_group
  use pd_scene_groups_relaxation, only: relaxation_group
  use pd_scene_groups_rigid, only: rigid_group
  use pd_scene_groups_section, only: section_group
  use pd_scene_groups_shape, only: is_of_file, no_fail_group, region_group, shape_group
  use pd_scene_groups_side, only: side_group
  use pd_scene_groups_study, only: study_group
  use pd_scene_groups_time, only: time_group
  use pd_scene_groups_tip, only: tip_group
  implicit none (type, external)
  private
  public :: scene_type, header_type, define_group, body_group, shape_group, region_group, &
    & is_of_file, no_fail_group, material_group, horizon_group, crack_group, initial_group, &
    & boundary_group, load_group, time_group, relaxation_group, output_group, probe_group, &
    & tip_group, section_group, line_group, j_integral_group, side_group, study_group, &
    & contact_group, rigid_group, refine_group, name_length, path_length, text_length, unset, &
    & is_set, is_given
  public :: adds_layer, has_cut_cells, has_grid, is_box, is_lattice, is_turned, words_of_body
  public :: has_refinement, has_own_horizons, laws_of, added_type, group_entry, group_table, &
    & group_interface, groups_interface

  !> A group that the scene has no component for.
  type :: added_type
    character(name_length) :: name = ''
    class(group_type), allocatable :: group
  end type added_type

  !> One line of the table of groups.
  type :: group_entry
    character(name_length) :: name = ''          !! as in the file, without `&`
    character(:), allocatable :: purpose         !! what it is for, in one or two sentences
    logical :: repeatable = .false.              !! may be given more than once
    class(group_type), allocatable :: fresh      !! one with all keys at their defaults
    procedure(group_interface), pointer, nopass :: one => null()   !! where the scene has it, ...
    procedure(groups_interface), pointer, nopass :: all => null()  !! ... or has all of them;
                                                                   !! none: in `scene%added`
  end type group_entry

  !> The groups that a scene may have, in the order of the reference. It is used for reading,
  !> writing, the reference, templates, changes of keys and their effect on a restart.
  type :: group_table
    type(group_entry), allocatable :: entries(:) !! with room at the end
    integer :: count = 0
  contains
    procedure :: add
    procedure :: names
    procedure :: place_of
    procedure :: describe
    procedure :: number_in
    procedure :: make_room
    procedure :: complete
    procedure :: visit
  end type group_table

  !> The content of a scene file.
  type :: scene_type
    character(:), allocatable :: file            !! where it was read from ('' = built in memory)
    character(:), allocatable :: text            !! the file's text
    type(line_type), allocatable :: changes(:)   !! `group%key=value`: what `--set` changes in it
    type(header_type) :: header
    type(define_group), allocatable :: definitions(:)
    type(body_group), allocatable :: bodies(:)
    type(shape_group), allocatable :: kept(:)
    type(shape_group), allocatable :: removed(:)
    type(refine_group), allocatable :: refines(:)
    type(region_group), allocatable :: regions(:)
    type(side_group), allocatable :: sides(:)
    type(material_group), allocatable :: materials(:)
    type(horizon_group) :: horizon
    type(crack_group), allocatable :: cracks(:)
    type(no_fail_group), allocatable :: no_fail(:)
    type(initial_group), allocatable :: initial(:)
    type(boundary_group), allocatable :: boundaries(:)
    type(load_group), allocatable :: loads(:)
    type(rigid_group), allocatable :: rigids(:)
    type(contact_group), allocatable :: contacts(:)
    type(time_group) :: time
    type(relaxation_group) :: relaxation
    type(output_group) :: output
    type(probe_group), allocatable :: probes(:)
    type(tip_group), allocatable :: tips(:)
    type(section_group), allocatable :: sections(:)
    type(line_group), allocatable :: lines(:)
    type(j_integral_group), allocatable :: j_integrals(:)
    type(study_group), allocatable :: studies(:)
    type(added_type), allocatable :: added(:)    !! groups of a table with more than these
    type(group_table), allocatable :: table      !! that table; without, the program's own
    type(law_table_type) :: laws                 !! bond laws; without any, the program's own
  end type scene_type

  abstract interface
    !> Where a scene has a group that is given once.
    subroutine group_interface(scene, group)
      import :: group_type, scene_type
      implicit none (type, external)
      type(scene_type), intent(inout), target :: scene  !! the scene
      class(group_type), pointer, intent(out) :: group  !! its group, not a copy
    end subroutine group_interface

    !> Where a scene has all groups of a kind, of size 0 if they are not allocated. With `room` they
    !> are allocated again, with this size.
    subroutine groups_interface(scene, groups, room)
      import :: group_type, scene_type
      implicit none (type, external)
      type(scene_type), intent(inout), target :: scene
        !! whose list is allocated on return, and new with `room`
      class(group_type), pointer, intent(out) :: groups(:)  !! (any number) its groups, not copies
      integer, intent(in), optional :: room
        !! number of new groups; without, the groups stay as they are
    end subroutine groups_interface
  end interface

contains

  !> Whether lattices are finer in some places.
  pure logical function has_refinement(scene)
    type(scene_type), intent(in) :: scene  !! any scene
    has_refinement = .false.
    if (allocated(scene%refines)) has_refinement = size(scene%refines) > 0
  end function has_refinement

  !> Whether each point has a horizon of its own: `ratio` times its spacing. Lattices of different
  !> spacings have, unless a length is given for all.
  pure logical function has_own_horizons(scene)
    type(scene_type), intent(in) :: scene  !! any scene
    has_own_horizons = scene%horizon%local .or. has_refinement(scene) &
      & .or. has_different_grids(scene)
  end function has_own_horizons

  !> Whether all bodies are lattices, whose spacings differ, with horizons by a ratio.
  pure logical function has_different_grids(scene)
    type(scene_type), intent(in) :: scene  !! any scene
    real(wp), parameter :: same = 1.0e-6_wp  ! as cells may be off from cubes by digits of corners
    real(wp) :: spacing, least, most
    integer :: i

    has_different_grids = .false.
    if (is_set(scene%horizon%length) .or. .not. allocated(scene%bodies)) return
    if (.not. all(has_grid(scene%bodies))) return
    least = huge(least)
    most = 0.0_wp
    do i = 1, size(scene%bodies)
      associate (body => scene%bodies(i))
        spacing = body%spacing
        if (.not. is_set(spacing)) spacing = (body%upper(1) - body%lower(1))/max(1, body%points(1))
        least = min(least, spacing)
        most = max(most, spacing)
      end associate
    end do
    has_different_grids = most - least > same*most
  end function has_different_grids

  !> The bond laws that a scene may name: its own table, else that of the program.
  function laws_of(scene) result(laws)
    type(scene_type), intent(in) :: scene  !! any scene
    type(law_table_type) :: laws

    laws = all_laws()
    if (allocated(scene%laws%items)) laws = scene%laws
  end function laws_of

  !> Add a group. Without `one` or `all` the scene holds it among `added`.
  subroutine add(table, name, purpose, repeatable, fresh, one, all)
    class(group_table), intent(inout) :: table  !! with one more line at its end on return
    character(*), intent(in) :: name        !! as in the file, lower case, without `&`
    character(*), intent(in) :: purpose     !! what it is for, in one or two sentences
    logical, intent(in) :: repeatable       !! may be given more than once
    class(group_type), intent(in) :: fresh  !! one with all keys at their defaults
    procedure(group_interface), optional :: one   !! where a scene has it
    procedure(groups_interface), optional :: all  !! where a scene has all of them
    type(group_entry), allocatable :: longer(:)
    integer, parameter :: room = 24
    integer :: i

    if (.not. allocated(table%entries)) allocate (table%entries(room))
    if (table%place_of(name) > 0) call internal_fault('the group '//name//' is added twice')
    if (table%count == size(table%entries)) then
      allocate (longer(2*table%count))
      do i = 1, table%count
        longer(i) = table%entries(i)
      end do
      call move_alloc(longer, table%entries)
    end if
    table%count = table%count + 1
    associate (entry => table%entries(table%count))
      entry%name = name
      entry%purpose = purpose
      entry%repeatable = repeatable
      allocate (entry%fresh, source=fresh)
      if (present(one)) entry%one => one
      if (present(all)) entry%all => all
    end associate
  end subroutine add

  !> The names of all groups, in the order of the table.
  pure function names(table)
    class(group_table), intent(in) :: table  !! the table
    character(name_length) :: names(table%count)

    names(:) = table%entries(:table%count)%name
  end function names

  !> The line of a group in the table, 0 if there is no such group.
  pure integer function place_of(table, name) result(place)
    class(group_table), intent(in) :: table  !! the table
    character(*), intent(in) :: name         !! as in the file, lower case, without `&`

    do place = table%count, 1, -1
      if (table%entries(place)%name == name) return
    end do
  end function place_of

  !> Register all keys of a group with their defaults in `keys`.
  subroutine describe(table, name, keys)
    class(group_table), intent(in) :: table
      !! with this group; another name is a fault of the program
    character(*), intent(in) :: name         !! as in the file, lower case, without `&`
    type(keys_type), intent(inout) :: keys   !! started anew; describes the group on return
    class(group_type), allocatable :: fresh

    if (table%place_of(name) == 0) call internal_fault('there is no group '//name)
    call keys%start(mode_describe)
    ! the visitor may change the group
    allocate (fresh, source=table%entries(table%place_of(name))%fresh)
    call fresh%visit(keys)
  end subroutine describe

  !> How many groups of line `place` a scene has.
  integer function number_in(table, scene, place) result(number)
    class(group_table), intent(in) :: table           !! of the scene's groups
    type(scene_type), intent(inout), target :: scene
      !! whose list is allocated, if empty, on return
    integer, intent(in) :: place                      !! line of the table
    class(group_type), pointer :: groups(:)

    associate (entry => table%entries(place))
      number = 1
      if (associated(entry%all)) then
        call entry%all(scene, groups)
        number = size(groups)
      else if (.not. associated(entry%one)) then
        number = 0
        if (allocated(scene%added)) number = count(scene%added%name == entry%name)
      end if
    end associate
  end function number_in

  !> Give a scene so many new groups of line `place`.
  subroutine make_room(table, scene, place, number)
    class(group_table), intent(in) :: table           !! of the scene's groups
    type(scene_type), intent(inout), target :: scene
      !! with new groups of this line, at their defaults, on return; those before are lost
    integer, intent(in) :: place                      !! line of the table
    integer, intent(in) :: number
      !! of new groups; counts only where the group may be repeated or is among `added`
    class(group_type), pointer :: groups(:)
    type(added_type), allocatable :: added(:)
    integer :: i, kept

    associate (entry => table%entries(place))
      if (associated(entry%all)) then
        call entry%all(scene, groups, number)
      else if (.not. associated(entry%one)) then
        if (.not. allocated(scene%added)) allocate (scene%added(0))
        kept = count(scene%added%name /= entry%name)
        allocate (added(kept + number))
        kept = 0
        do i = 1, size(scene%added)
          if (scene%added(i)%name == entry%name) cycle
          kept = kept + 1
          added(kept)%name = scene%added(i)%name
          call move_alloc(scene%added(i)%group, added(kept)%group)
        end do
        do i = kept + 1, size(added)
          added(i)%name = entry%name
          allocate (added(i)%group, source=entry%fresh)
        end do
        call move_alloc(added, scene%added)
      end if
    end associate
  end subroutine make_room

  !> Allocate missing lists of a scene with size 0, so that loops need no test.
  subroutine complete(table, scene)
    class(group_table), intent(in) :: table           !! of the scene's groups
    type(scene_type), intent(inout), target :: scene  !! with all lists allocated on return
    class(group_type), pointer :: groups(:)
    integer :: g

    if (.not. allocated(scene%added)) allocate (scene%added(0))
    do g = 1, table%count
      if (associated(table%entries(g)%all)) call table%entries(g)%all(scene, groups)
    end do
  end subroutine complete

  !> Show the keys of a scene's `number`-th group of line `place` to a visitor.
  subroutine visit(table, scene, place, number, keys)
    class(group_table), intent(in) :: table           !! of the scene's groups
    type(scene_type), intent(inout), target :: scene  !! whose group the visitor may read or set
    integer, intent(in) :: place                      !! line of the table
    integer, intent(in) :: number                     !! which group of this line, from 1
    type(keys_type), intent(inout) :: keys
      !! the visitor, started for reading, writing or describing
    class(group_type), pointer :: group, groups(:)
    integer :: i, found

    associate (entry => table%entries(place))
      if (associated(entry%one)) then
        call entry%one(scene, group)
        call group%visit(keys)
      else if (associated(entry%all)) then
        call entry%all(scene, groups)
        call groups(number)%visit(keys)
      else
        found = 0
        do i = 1, size(scene%added)
          if (scene%added(i)%name /= entry%name) cycle
          found = found + 1
          if (found == number) call scene%added(i)%group%visit(keys)
        end do
      end if
    end associate
  end subroutine visit

end module pd_scene_content_types
