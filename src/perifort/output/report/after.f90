!> The summary printed at the end of a run.
module pd_output_report_after
  use pd_base_kinds, only: wp, i8
  use pd_base_reduce, only: count_of_ranks, largest_of_ranks, largest_over
  use pd_base_system, only: peak_memory
  use pd_base_text, only: counted, line => labelled_line, newline, to_text, with_unit
  use pd_motion_system, only: system_type
  use pd_output_report_recorder, only: recorder_type
  implicit none (type, external)
  private
  public :: summary_after

contains

  !> Summary of the run: time per phase, speed, energies, damage, where the results are.
  function summary_after(system, recorder, directory) result(text)
    type(system_type), intent(in) :: system
    type(recorder_type), intent(in) :: recorder
    character(*), intent(in) :: directory   !! of the results; '' = there are no files
    character(:), allocatable :: text, parts, unit
    real(wp) :: balance, share, of_dissipated, seconds
    integer :: steps

    text = recorder%timer%table()//newline
    steps = recorder%steps_done - recorder%first_step
    unit = trim(merge('iteration', 'step     ', recorder%schedule%relaxation))
    seconds = recorder%timer%seconds(recorder%phase())
    if (steps > 0) text = text//line('speed', &
      & to_text(1.0e9_wp*seconds/(real(system%family%n_bonds, wp)*steps), 3)// &
      & ' ns per bond and '//unit//', '//to_text(steps/max(1.0e-9_wp, seconds), 4)// &
      & ' '//unit//'s/s')
    if (recorder%team%report() /= '') text = text//line('threads', recorder%team%report())
    if (associated(system%body%order%ranks)) text = text//messages_of(system, max(1, steps), &
      & seconds, unit)
    if (recorder%gave_way > 0) text = text//line('solver', counted(recorder%gave_way, &
      & 'load step')//' left to dynamic relaxation by the conjugate gradient')
    associate (now => recorder%balance%energies)
      text = text//line('kinetic energy', with_unit(now%kinetic, 'J'))
      text = text//line('strain energy', with_unit(now%strain, 'J'))
      if (system%model%breaking) then
        text = text//line('dissipated', with_unit(system%dissipated, 'J'))
        text = text//line('broken bonds', to_text(system%broken)//' pairs of points')
        text = text//line('greatest damage', to_text(largest_over(system%body%order, &
          & system%state%damage), 3))
      end if
      text = text//line('external work', with_unit(system%external_work, 'J'))
      call recorder%energy_balance(system, balance, share, of_dissipated)
      if (share >= 0.0_wp) then
        parts = to_text(100*share, 2)//' % of the greater of the energy supplied and the '// &
          & 'energy present'
        if (of_dissipated >= 0.0_wp) parts = parts//', '// &
          & to_text(100*of_dissipated, 2)//' % of the dissipated energy'
        text = text//line('energy balance', 'off by '//with_unit(balance, 'J')//', '//parts)
      end if
    end associate
    if (recorder%warnings%count() > 0) text = text//line('warnings', &
      & to_text(recorder%warnings%count())//trim(merge(', kept in warnings.txt', &
      & repeat(' ', 22), directory /= '')))
    if (directory == '') then
      text = text//line('results', 'in memory alone')
    else if (recorder%results%written_by() /= '') then
      text = text//line('results', directory//', fields written by '//recorder%results%written_by())
    else
      text = text//line('results', directory)
    end if
  end function summary_after

  !> What ranks have sent each other: of all together, and the time of the rank that took longest.
  function messages_of(system, steps, seconds, unit) result(text)
    type(system_type), intent(in) :: system
    integer, intent(in) :: steps           !! steps or iterations
    real(wp), intent(in) :: seconds        !! of all of them [s]
    character(*), intent(in) :: unit       !! what a step is called
    character(:), allocatable :: text
    real(wp) :: sharing, summing, largest
    integer(i8) :: bytes, messages, memory

    associate (order => system%body%order)
      bytes = count_of_ranks(order, order%ranks%bytes)
      messages = count_of_ranks(order, order%ranks%messages)
      sharing = largest_of_ranks(order, order%ranks%sharing)
      summing = largest_of_ranks(order, order%ranks%summing)
      text = line('messages', with_unit(real(bytes, wp)/steps, 'B', 6)//' in '// &
        & to_text(real(messages, wp)/steps, 4)//' messages a '//unit//' of all ranks, '// &
        & to_text(100*sharing/max(seconds, tiny(seconds)), 2)//' % of the time') &
        & //line('sums', to_text(real(order%ranks%sums, wp)/steps, 3)//' over all ranks a '// &
        & unit//', '//to_text(100*summing/max(seconds, tiny(seconds)), 2)// &
        & ' % of the time with waiting')
      memory = count_of_ranks(order, peak_memory())
      largest = largest_of_ranks(order, real(peak_memory(), wp))
      if (memory > 0_i8) text = text//line('peak memory', 'of the rank with the most '// &
        & with_unit(largest, 'B', 4)//', of all '//with_unit(real(memory, wp), 'B', 4))
    end associate
  end function messages_of

end module pd_output_report_after
