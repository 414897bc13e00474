!> Continuing a run from a checkpoint: which one, whether it fits the scene, and putting the run
!> back to where it was.
module pd_output_checkpoint_restart
  use pd_base_error, only: error_type, fail, internal_fault
  use pd_base_kinds, only: i8
  use pd_base_text, only: newline, to_text, with_unit
  use pd_comm_world, only: world_type
  use pd_base_version, only: compiler_flags, compiler_name, program_version
  use pd_motion_keep, only: checksum_of_start, keep_system
  use pd_set_up_plan, only: plan_type, steps_of
  use pd_motion_system, only: system_type
  use pd_output_checkpoint_checkpoint, only: about_type, checkpoint_path, older_path, open_about, &
    & stem_of_part
  use pd_output_checkpoint_file, only: reader_type
  use pd_output_checkpoint_earlier, only: existing_results, mark_complete, refuse_existing, &
    & scene_of_results, unfinished
  use pd_output_checkpoint_merger, only: merger_type, part_path_type
  use pd_output_checkpoint_sets, only: find_set, set_type
  use pd_output_measures_measure, only: measure_list_type
  use pd_output_results_files, only: file_exists, in_directory
  use pd_scene_content_compare, only: difference_type, scene_differences
  use pd_scene_content_groups, only: table_of
  use pd_scene_content_types, only: group_table, scene_type, is_set
  use pd_scene_content_write, only: scene_text
  use pd_scene_format_keys, only: keys_type
  use pd_scene_groups_group, only: change_harmless, change_of_the_end, change_of_the_files, &
    & change_refused
  implicit none (type, external)
  private
  public :: restart_type, find_restart, put_back

  !> The state from which a run continues.
  type :: restart_type
    logical :: found = .false.         !! there is a checkpoint to start from
    logical :: complete = .false.      !! the run is complete: there is nothing to do
    logical :: newest = .true.         !! the newest file of this rank belongs to it
    integer :: rank = 0                !! this one
    integer :: ranks = 1               !! of the run
    type(about_type) :: about          !! of the first rank, if it comes from another number of them
    type(reader_type) :: reader        !! open, at the system
    type(part_path_type), allocatable :: parts(:)
      !! files of another number of ranks; not allocated: `reader` has all of this rank
    character(:), allocatable :: note  !! message to the user
    logical :: longer = .false.        !! the end of the run may have changed
  end type restart_type

contains

  !> Find the checkpoint of a run in its folder, or take the one that is named, and compare its
  !> scene with the present one.
  !>
  !> Where there is no checkpoint, the run starts from the beginning (`found` is false), unless its
  !> results are complete. On several ranks all must call it together; the checkpoints may be those
  !> of another number of them.
  !>
  !> An error if the checkpoint cannot be read or is damaged, if the scene has changed in what may
  !> not change, or if there are results of another scene.
  subroutine find_restart(directory, stem, named, scene, command, world, restart, error)
    character(*), intent(in) :: directory       !! folder of the results; '' for the current one
    character(*), intent(in) :: stem            !! name of the results' files without their endings
    character(*), intent(in) :: named  !! path of a checkpoint, '' = the run's newest
    type(scene_type), intent(in) :: scene       !! the present one
    character(*), intent(in) :: command  !! starts the run again with `--restart`, for messages
    type(world_type), intent(inout) :: world    !! the ranks of the run
    type(restart_type), intent(out) :: restart  !! where to start, with its file open at the system
                                                !! if one is found
    type(error_type), allocatable, intent(out) :: error
    type(set_type) :: set
    character(:), allocatable :: path, newest
    integer :: r

    restart%note = ''
    restart%rank = world%rank
    restart%ranks = world%ranks
    newest = checkpoint_path(directory, stem_of_part(stem, world%rank, world%ranks))
    if (named /= '' .and. world%ranks > 1) then
      call fail(error, 'a run on several ranks finds its checkpoints by itself: give --restart '// &
        & 'without a path')
      return
    else if (named /= '') then
      path = named
      restart%newest = path == newest
    else
      call find_set(directory, stem, world, set, error)
      if (allocated(error)) return
      if (set%ranks == 0) then
        call find_nothing(directory, stem, scene, restart, error)
        return
      end if
      ! of another number of ranks the first one's file tells of the run
      r = merge(world%rank, 0, set%ranks == world%ranks)
      path = set%path_of(directory, stem, r)
      restart%newest = .false.
      if (world%rank < set%ranks) &
        & restart%newest = set%path_of(directory, stem, world%rank) == newest
      if (set%ranks /= world%ranks) then
        allocate (restart%parts(set%ranks))
        do r = 0, set%ranks - 1
          restart%parts(r + 1)%path = set%path_of(directory, stem, r)
        end do
      end if
    end if
    call open_about(path, restart%reader, restart%about, error, set%verified)
    if (allocated(error)) then
      if (path == newest) call offer_older(older_path(newest), command, error)
      return
    end if
    if (restart%about%ranks > 1 .and. .not. set%verified) then
      call fail(error, path//' is one of the checkpoints of '//to_text(restart%about%ranks)// &
        & ' ranks, and has a part of the points only: give --restart without a path')
      call restart%reader%close()
      return
    end if
    if (allocated(restart%parts)) call restart%reader%close()
    restart%found = .true.
    if (allocated(restart%parts)) path = path//', of '//to_text(set%ranks)// &
      & trim(merge(' rank ', ' ranks', set%ranks == 1))
    restart%note = '  restart         from step '//to_text(restart%about%step)//', t = '// &
      & with_unit(restart%about%time, 's', 6)//' ('//path//')'
    if (allocated(set%note)) restart%note = restart%note//set%note
    call check_build(restart)
    call compare(directory, stem, scene, restart, error)
    if (allocated(error)) return
    if (.not. restart%about%finished .or. restart%longer) return
    restart%complete = .true.
    call mark_complete(directory, stem)
    restart%note = restart%note//newline//'  complete        the run is finished; '// &
      & 'increase &time steps or duration to continue it'
  end subroutine find_restart

  !> No checkpoint: from the beginning, or nothing to do, or results that must not go.
  subroutine find_nothing(directory, stem, scene, restart, error)
    character(*), intent(in) :: directory, stem
    type(scene_type), intent(in) :: scene
    type(restart_type), intent(inout) :: restart
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: ignored
    character(:), allocatable :: text

    if (existing_results(directory, stem) == '' .or. unfinished(directory, stem)) then
      restart%note = '  restart         there is no checkpoint in '//directory// &
        & ' yet: the run starts from the beginning'
      return
    end if
    call scene_of_results(in_directory(directory, stem//'.vtkhdf'), text, ignored)
    if (.not. allocated(ignored)) restart%complete = text == scene_text(scene)
    restart%note = '  complete        the results of this scene exist already: '// &
      & existing_results(directory, stem)
    if (.not. restart%complete) call refuse_existing(directory, stem, .false., error)
  end subroutine find_nothing

  !> Add to the error of the newest checkpoint how to continue from the one before it.
  subroutine offer_older(path, command, error)
    character(*), intent(in) :: path, command
    type(error_type), allocatable, intent(inout) :: error
    type(reader_type) :: reader
    type(about_type) :: about
    type(error_type), allocatable :: fault

    if (.not. file_exists(path)) then
      error%message = error%message//newline//'  there is no older one: --overwrite without '// &
        & '--restart starts again'
      return
    end if
    call open_about(path, reader, about, fault)
    if (allocated(fault)) then
      error%message = error%message//newline//'  the one before it is damaged, too ('// &
        & fault%message//'): --overwrite without --restart starts again'
    else
      call reader%close()
      error%message = error%message//newline//'  the one before it, of step '// &
        & to_text(about%step)//', is intact; to continue from there: '//command//' '//path
    end if
  end subroutine offer_older

  !> Say so if another build of the program wrote the checkpoint.
  subroutine check_build(restart)
    type(restart_type), intent(inout) :: restart

    associate (about => restart%about)
      if (about%version == program_version .and. about%compiler == compiler_name() .and. &
        & about%flags == compiler_flags()) return
      restart%note = restart%note//newline//'  note            another build wrote it, so that '// &
        & 'the last bits may differ: perifort '//about%version//', '//about%compiler
    end associate
  end subroutine check_build

  !> Effect of a changed key on a restart, as defined by its group.
  integer function meaning_of(difference, table) result(meaning)
    type(difference_type), intent(in) :: difference
    type(group_table), intent(in) :: table

    meaning = change_refused
    associate (place => table%place_of(difference%group))
      if (place > 0) meaning = table%entries(place)%fresh%change_of(difference%key)
    end associate
  end function meaning_of

  !> All that may change: `&time steps, duration; &output`.
  function changeable(table) result(text)
    type(group_table), intent(in) :: table
    character(:), allocatable :: text, keys_of_group
    type(keys_type) :: keys
    integer :: g, k

    text = ''
    do g = 1, table%count
      associate (entry => table%entries(g))
        keys_of_group = ''
        ! a group of which all may change is named alone
        if (entry%fresh%change_of('') == change_refused) then
          call table%describe(trim(entry%name), keys)
          do k = 1, keys%count
            if (entry%fresh%change_of(keys%known(k)%name) == change_refused) cycle
            if (len(keys_of_group) > 0) keys_of_group = keys_of_group//','
            keys_of_group = keys_of_group//' '//keys%known(k)%name
          end do
          if (len(keys_of_group) == 0) cycle
        end if
        if (len(text) > 0) text = text//'; '
        text = text//'&'//trim(entry%name)//keys_of_group
      end associate
    end do
  end function changeable

  !> Compare the scenes: list the changes, or refuse them.
  subroutine compare(directory, stem, scene, restart, error)
    character(*), intent(in) :: directory, stem
    type(scene_type), intent(in) :: scene
    type(restart_type), intent(inout) :: restart
    type(error_type), allocatable, intent(out) :: error
    type(difference_type), allocatable :: differences(:)
    type(group_table) :: table
    character(:), allocatable :: wrong, other_files
    logical :: other_columns
    integer :: i

    call table_of(scene, table)
    differences = scene_differences(restart%about%kept%scene_text, scene_text(scene))
    wrong = ''
    other_files = ''
    other_columns = .false.
    do i = 1, size(differences)
      select case (meaning_of(differences(i), table))
      case (change_refused)
        wrong = wrong//newline//'  '//differences(i)%text
        cycle
      case (change_of_the_end)
        restart%longer = .true.
      case (change_of_the_files)
        other_files = other_files//newline//'  '//differences(i)%text
        other_columns = other_columns .or. differences(i)%group /= 'output' .or. &
          & differences(i)%key == 'fragments'
      case (change_harmless)
        continue
      case default
        call internal_fault('compare does not know what a change means')
      end select
      restart%note = restart%note//newline//'  changed         '//differences(i)%text
    end do
    if (wrong /= '') then
      call fail(error, 'the scene has changed since the checkpoint was written:'//wrong//newline// &
        & '  may change: '//changeable(table)//newline//'  --overwrite without --restart '// &
        & 'computes the new scene from the beginning')
    else if (other_files /= '' .and. existing_results(directory, stem) /= '') then
      call fail(error, 'the existing results have another form than the scene requires:'// &
        & other_files//newline//'  --restart CHECKPOINT --output OTHER continues the run in '// &
        & 'another folder, whose results begin at the checkpoint')
    end if
    ! earlier rows have other columns: the history begins at the checkpoint, too
    if (other_columns .and. .not. allocated(error)) &
      & restart%about%kept%rows = restart%about%kept%rows(:, :0)
    if (allocated(error)) call restart%reader%close()
  end subroutine compare

  !> Set a system made from the scene to the state of the checkpoint, and the plan to its time step.
  !> An error if the points or the initial state are others, if the checkpoint is beyond the end of
  !> the run, or if it does not hold what the system needs.
  subroutine put_back(restart, scene, points, system, plan, measures, error)
    type(restart_type), intent(inout) :: restart  !! with the checkpoint's file open; closed on
                                                  !! return
    type(scene_type), intent(in) :: scene         !! the present one, for its duration
    integer(i8), intent(in) :: points             !! checksum of the system's points of all ranks
    type(system_type), intent(inout) :: system    !! as it was made from the scene; as in the
                                                  !! checkpoint on return
    type(plan_type), intent(inout) :: plan        !! gets time step and number of steps, unless it
                                                  !! is a relaxation
    type(measure_list_type), intent(inout) :: measures  !! of the history, begun; as in the
                                                        !! checkpoint on return
    type(error_type), allocatable, intent(out) :: error
    type(merger_type) :: merger
    logical :: others

    others = points /= restart%about%points
    if (.not. (others .or. allocated(restart%parts))) &
      & others = checksum_of_start(system) /= restart%about%start
    if (others) then
      call fail(error, 'the points or the initial state are not those of the checkpoint: has a '// &
        & 'file that the scene names changed, or was it written by another version?')
    else if (.not. plan%relaxes) then
      plan%step = restart%about%dt
      if (is_set(scene%time%duration)) &
        & plan%steps = steps_of(scene%time%duration, plan%step)
      if (plan%steps < restart%about%step) call fail(error, 'the checkpoint is of step '// &
        & to_text(restart%about%step)//', beyond the '//to_text(plan%steps)//' of the scene')
      restart%complete = plan%steps == restart%about%step .and. restart%about%finished
    end if
    if (.not. allocated(error) .and. allocated(restart%parts)) then
      call merger%open(restart%parts)
      call keep_system(merger, system)
      call measures%keep(merger)
      call merger%close()
      if (allocated(merger%error)) call move_alloc(merger%error, error)
    else if (.not. allocated(error)) then
      call keep_system(restart%reader, system)
      call measures%keep(restart%reader)
      if (allocated(restart%reader%error)) call move_alloc(restart%reader%error, error)
    end if
    call restart%reader%close()
  end subroutine put_back

end module pd_output_checkpoint_restart
