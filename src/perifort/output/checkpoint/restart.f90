!> Continuing a run from a checkpoint: which one, whether it fits the scene, and putting the run
!> back to where it was.
module pd_output_checkpoint_restart
  use pd_base_error, only: error_type, fail, internal_fault
  use pd_base_kinds, only: wp
  use pd_base_text, only: newline, to_text, with_unit
  use pd_comm_world, only: world_type
  use pd_base_version, only: compiler_flags, compiler_name, program_version
  use pd_motion_keep, only: checksum_of_start, keep_system
  use pd_set_up_plan, only: plan_type, steps_of
  use pd_motion_system, only: system_type
  use pd_output_checkpoint_checkpoint, only: about_type, checkpoint_path, keep_about, older_path
  use pd_output_checkpoint_file, only: reader_type
  use pd_output_checkpoint_earlier, only: existing_results, mark_complete, refuse_existing, &
    & scene_of_results, unfinished
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
  public :: restart_type, find_restart, put_back, common_checkpoint

  !> The state from which a run continues.
  type :: restart_type
    logical :: found = .false.         !! there is a checkpoint to start from
    logical :: complete = .false.      !! the run is complete: there is nothing to do
    logical :: newest = .true.         !! it is the newest of its run
    type(about_type) :: about
    type(reader_type) :: reader        !! open, at the system
    character(:), allocatable :: note  !! message to the user
    logical :: longer = .false.        !! the end of the run may have changed
  end type restart_type

contains

  !> Find the checkpoint of a run in its folder, or take the one that is named, and compare its
  !> scene with the present one.
  !>
  !> Where there is no checkpoint, the run starts from the beginning (`found` is false), unless its
  !> results are complete.
  !>
  !> An error if the checkpoint cannot be read or is damaged, if the scene has changed in what may
  !> not change, or if there are results of another scene.
  subroutine find_restart(directory, stem, named, scene, command, restart, error, kept_stem)
    character(*), intent(in) :: directory       !! folder of the results; '' for the current one
    character(*), intent(in) :: stem            !! name of the results' files without their endings
    character(*), intent(in) :: named  !! path of a checkpoint, '' = the run's newest
    type(scene_type), intent(in) :: scene       !! the present one
    character(*), intent(in) :: command  !! starts the run again with `--restart`, for messages
    type(restart_type), intent(out) :: restart  !! where to start, with its file open at the system
                                                !! if one is found
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: kept_stem  !! of the checkpoints' names; `stem` if absent
    character(:), allocatable :: path, newest

    restart%note = ''
    newest = checkpoint_path(directory, stem)
    if (present(kept_stem)) newest = checkpoint_path(directory, kept_stem)
    path = named
    if (path == '') then
      path = newest
      if (.not. file_exists(newest)) path = older_path(newest)
      if (.not. file_exists(path)) then
        call find_nothing(directory, stem, scene, restart, error)
        return
      end if
    end if
    restart%newest = path == newest
    call open_checkpoint(path, restart, error)
    if (allocated(error)) then
      if (path == newest) call offer_older(older_path(newest), command, error)
      return
    end if
    restart%found = .true.
    restart%note = '  restart         from step '//to_text(restart%about%step)//', t = '// &
      & with_unit(restart%about%time, 's', 6)//' ('//path//')'
    call check_build(restart)
    call compare(directory, stem, scene, restart, error)
    if (allocated(error)) return
    if (.not. restart%about%finished .or. restart%longer) return
    restart%complete = .true.
    call mark_complete(directory, stem)
    restart%note = restart%note//newline//'  complete        the run is finished; '// &
      & 'increase &time steps or duration to continue it'
  end subroutine find_restart

  !> The checkpoint of this rank from which all ranks can go on: that of the last step of which all
  !> have one. An error if the ranks have none in common, though some have one, or if one is named:
  !> each rank has its own.
  subroutine common_checkpoint(directory, stem, world, named, error)
    character(*), intent(in) :: directory        !! of the checkpoints
    character(*), intent(in) :: stem             !! of this rank's names
    type(world_type), intent(inout) :: world     !! the ranks
    character(:), allocatable, intent(inout) :: named
      !! path that the user names, which must be empty; that of the checkpoint on return, empty
      !! where no rank has any
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: steps(2), newest(1), most(1), missing(1)
    integer :: step

    if (named /= '') then
      call fail(error, 'a run on several ranks finds its checkpoints by itself: give --restart '// &
        & 'without a path')
      return
    end if
    steps = [step_of(checkpoint_path(directory, stem)), &
      & step_of(older_path(checkpoint_path(directory, stem)))]
    ! the newest that each rank has, of which the oldest counts
    newest = -max(steps(1), steps(2))
    most = -newest
    call world%take_largest(newest)
    call world%take_largest(most)
    step = -nint(newest(1))
    if (nint(most(1)) < 0) return
    missing = 0.0_wp
    if (all(nint(steps) /= step) .or. step < 0) missing = 1.0_wp
    call world%take_largest(missing)
    if (missing(1) > 0.5_wp) then
      call fail(error, 'the checkpoints in '//directory//' do not belong together: has the run '// &
        & 'another number of ranks than '//to_text(world%ranks)//', or is one damaged?'//newline// &
        & '  --overwrite without --restart starts again')
      error%everywhere = .true.
      error%elsewhere = world%rank > 0
      return
    end if
    named = checkpoint_path(directory, stem)
    if (nint(steps(1)) /= step) named = older_path(named)
  end subroutine common_checkpoint

  !> The step of a checkpoint; -1 if there is none that can be read.
  real(wp) function step_of(path) result(step)
    character(*), intent(in) :: path
    type(restart_type) :: restart
    type(error_type), allocatable :: ignored

    step = -1.0_wp
    if (.not. file_exists(path)) return
    call open_checkpoint(path, restart, ignored)
    if (allocated(ignored)) return
    step = restart%about%step
    call restart%reader%close()
  end function step_of

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

  !> Open a checkpoint and read its description.
  subroutine open_checkpoint(path, restart, error)
    character(*), intent(in) :: path
    type(restart_type), intent(inout) :: restart
    type(error_type), allocatable, intent(out) :: error

    call restart%reader%open(path, error)
    if (allocated(error)) return
    call keep_about(restart%reader, restart%about)
    if (.not. allocated(restart%reader%error)) return
    call move_alloc(restart%reader%error, error)
    call restart%reader%close()
  end subroutine open_checkpoint

  !> Add to the error of the newest checkpoint how to continue from the one before it.
  subroutine offer_older(path, command, error)
    character(*), intent(in) :: path, command
    type(error_type), allocatable, intent(inout) :: error
    type(restart_type) :: older
    type(error_type), allocatable :: fault

    if (.not. file_exists(path)) then
      error%message = error%message//newline//'  there is no older one: --overwrite without '// &
        & '--restart starts again'
      return
    end if
    call open_checkpoint(path, older, fault)
    if (allocated(fault)) then
      error%message = error%message//newline//'  the one before it is damaged, too ('// &
        & fault%message//'): --overwrite without --restart starts again'
    else
      call older%reader%close()
      error%message = error%message//newline//'  the one before it, of step '// &
        & to_text(older%about%step)//', is intact; to continue from there: '//command//' '//path
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
  subroutine put_back(restart, scene, system, plan, measures, error)
    type(restart_type), intent(inout) :: restart  !! with the checkpoint's file open; closed on
                                                  !! return
    type(scene_type), intent(in) :: scene         !! the present one, for its duration
    type(system_type), intent(inout) :: system    !! as it was made from the scene; as in the
                                                  !! checkpoint on return
    type(plan_type), intent(inout) :: plan        !! gets time step and number of steps, unless it
                                                  !! is a relaxation
    type(measure_list_type), intent(inout) :: measures  !! of the history, begun; as in the
                                                        !! checkpoint on return
    type(error_type), allocatable, intent(out) :: error

    if (checksum_of_start(system) /= restart%about%start) then
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
    if (.not. allocated(error)) then
      call keep_system(restart%reader, system)
      call measures%keep(restart%reader)
      if (allocated(restart%reader%error)) call move_alloc(restart%reader%error, error)
    end if
    call restart%reader%close()
  end subroutine put_back

end module pd_output_checkpoint_restart
