!> Scenes of texts that tests set up, or run in time.
module runs
  use omp_lib, only: omp_set_num_threads
  use pd_base_error, only: fault_type => error_type
  use pd_motion_explicit_integrators, only: run_explicit
  use pd_scene_content_types, only: scene_type
  use pd_set_up_prepare, only: prepare, set_up_type
  use perifort, only: read_scene_text
  use bodies, only: diary_type, ready, ready_alone
  use test_scene_expect, only: expect_parts, expect_scene
  use testdrive, only: error_type, test_failed
  implicit none (type, external)
  private
  public :: run, ready_text, refuse

contains

  !> Run the scene of a text to its end, on one thread or on so many.
  subroutine run(text, set_up, error, diary, threads)
    character(*), intent(in) :: text             !! of the scene: explicit steps
    type(set_up_type), intent(out) :: set_up     !! at the end
    type(error_type), allocatable, intent(inout) :: error
    type(diary_type), intent(inout), optional :: diary
      !! says how often it has a row; what stood in it is lost
    integer, intent(in), optional :: threads     !! 1 without
    type(scene_type) :: scene
    type(diary_type) :: own
    type(fault_type), allocatable :: fault

    call expect_scene(error, text, scene)
    if (present(threads)) then
      call omp_set_num_threads(threads)
      call ready(scene, set_up, error)
    else
      call ready_alone(scene, set_up, error)
    end if
    if (allocated(error)) return
    if (present(diary)) own = diary_type(every=diary%every, slot=diary%slot)
    call run_explicit(set_up%system, trim(scene%time%integrator), set_up%plan%step, &
      & set_up%plan%steps, own, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
    if (present(diary)) diary = own
  end subroutine run

  !> Set up the scene of a text; what is wrong with it fails the test.
  subroutine ready_text(text, set_up, error, alone)
    character(*), intent(in) :: text             !! of the scene
    type(set_up_type), intent(out) :: set_up
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in), optional :: alone       !! on one thread to the end of the test
    type(scene_type) :: scene
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    if (present(alone)) then
      if (alone) call omp_set_num_threads(1)
    end if
    call read_scene_text(text, '', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    if (allocated(fault)) call test_failed(error, fault%message)
  end subroutine ready_text

  !> Reading the scene of a text or setting it up must fail with these parts in the message.
  subroutine refuse(error, text, parts)
    type(error_type), allocatable, intent(inout) :: error
    character(*), intent(in) :: text   !! of the scene
    character(*), intent(in) :: parts  !! between bars
    type(scene_type) :: scene
    type(set_up_type) :: set_up
    type(fault_type), allocatable :: fault

    if (allocated(error)) return
    call read_scene_text(text, '', scene, fault)
    if (.not. allocated(fault)) call prepare(scene, set_up, fault)
    call expect_parts(error, fault, parts)
  end subroutine refuse

end module runs
