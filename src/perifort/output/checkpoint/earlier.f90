!> Results of earlier runs: whether there are any, and whether the run that wrote them was finished.
!> Until then there is a file `STEM.unfinished` beside them.
module pd_output_checkpoint_earlier
  use pd_base_error, only: error_type, fail
  use pd_base_text, only: newline
  use pd_output_checkpoint_checkpoint, only: checkpoint_path, stem_of_rank
  use pd_output_results_files, only: file_exists, in_directory, remove_file
  use pd_output_results_hdf5, only: close_file, get_text, hdf5_file, open_file, start_hdf5
  use pd_output_results_sink, only: sink_type
  implicit none (type, external)
  private
  public :: existing_results, refuse_existing, unfinished, mark_unfinished, mark_complete, &
    & scene_of_results

contains

  !> The first file of earlier results of this stem in `directory`; '' if there is none.
  function existing_results(directory, stem) result(path)
    character(*), intent(in) :: directory  !! folder of the results; '' for the current one
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    character(:), allocatable :: path

    path = in_directory(directory, trim(stem)//'.vtkhdf')
    if (file_exists(path)) return
    path = in_directory(directory, trim(stem)//'.pvd')
    if (file_exists(path)) return
    path = in_directory(directory, 'history.csv')
    if (.not. file_exists(path)) path = ''
  end function existing_results

  !> Whether earlier results are of an unfinished run.
  logical function unfinished(directory, stem)
    character(*), intent(in) :: directory  !! folder of the results; '' for the current one
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    unfinished = file_exists(mark_of(directory, stem))
  end function unfinished

  !> The file that is beside results until they are complete.
  pure function mark_of(directory, stem) result(path)
    character(*), intent(in) :: directory, stem
    character(:), allocatable :: path
    path = in_directory(directory, trim(stem)//'.unfinished')
  end function mark_of

  !> An error if there are earlier results or a checkpoint and they must not be overwritten. Cheap:
  !> meant to be called before any long preparation.
  subroutine refuse_existing(directory, stem, overwrite, error)
    character(*), intent(in) :: directory  !! folder of the results; '' for the current one
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    logical, intent(in) :: overwrite       !! older results may go: never an error
    type(error_type), allocatable, intent(out) :: error
    character(:), allocatable :: path

    if (overwrite) return
    path = existing_results(directory, stem)
    if (path == '' .and. file_exists(checkpoint_path(directory, stem))) &
      & path = checkpoint_path(directory, stem)
    if (path == '' .and. file_exists(checkpoint_path(directory, stem_of_rank(stem, 0)))) &
      & path = checkpoint_path(directory, stem_of_rank(stem, 0))
    if (path == '') return
    if (unfinished(directory, stem)) then
      call fail(error, 'results of an unfinished run exist already: '//path// &
        & ' (--restart continues them, --overwrite replaces them, --output DIR puts the new '// &
        & 'ones elsewhere)')
    else
      call fail(error, 'results exist already: '//path// &
        & ' (--overwrite replaces them, --output DIR puts the new ones elsewhere)')
    end if
  end subroutine refuse_existing

  !> Make the file that says that the results are not complete. An error if it cannot be written.
  subroutine mark_unfinished(directory, stem, error)
    character(*), intent(in) :: directory  !! folder of the results; '' for the current one
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: late
    type(sink_type) :: mark

    call mark%open(mark_of(directory, stem), error)
    if (allocated(error)) return
    call mark%line('The run that writes the results beside this file is in progress, or was '// &
      & 'stopped before its end.'//newline//'With --restart it continues.', error)
    call mark%close(late)
    if (.not. allocated(error)) call move_alloc(late, error)
  end subroutine mark_unfinished

  !> Remove the file of `mark_unfinished`: the results are complete.
  subroutine mark_complete(directory, stem)
    character(*), intent(in) :: directory  !! folder of the results; '' for the current one
    character(*), intent(in) :: stem       !! name of the results' files without their endings
    call remove_file(mark_of(directory, stem))
  end subroutine mark_complete

  !> The scene that a results file holds. An error if the file cannot be read or holds none.
  subroutine scene_of_results(path, text, error)
    character(*), intent(in) :: path                !! of a results file (HDF5)
    character(:), allocatable, intent(out) :: text  !! the resolved scene; '' after an error
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: ignored
    type(hdf5_file) :: file

    text = ''
    call start_hdf5(error)
    if (.not. allocated(error)) call open_file(path, .false., file, error)
    if (allocated(error)) return
    call get_text(file, '/scene/text', text, error)
    call close_file(file, ignored)
  end subroutine scene_of_results

end module pd_output_checkpoint_earlier
