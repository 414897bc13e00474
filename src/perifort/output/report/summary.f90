!> The summary printed before a run: the chosen methods and their reasons.
module pd_output_report_summary
  use pd_base_kinds, only: wp, i8
  use pd_base_clock, only: duration_text
  use pd_base_error, only: internal_fault
  use pd_base_reduce, only: largest_over
  use pd_base_warnings, only: warnings_type
  use pd_base_text, only: counted, line => labelled_line, newline, to_text, with_unit
  use pd_scene_content_types, only: scene_type
  use pd_family_composite, only: composite_family_type
  use pd_family_lattice, only: lattice_family_type
  use pd_family_list, only: list_family_type
  use pd_force_model, only: model_type
  use pd_set_up_plan, only: plan_type
  use pd_motion_system, only: system_type
  use pd_output_measures_measure, only: measure_list_type
  implicit none (type, external)
  private
  public :: summary_before, checkpoint_line, memory_of

contains

  !> The scene as it will be computed, a fact in each line: points, bonds, memory, forces, time
  !> step, what the history measures, and notes.
  function summary_before(scene, system, plan, measures, cut, warnings, notes, threads) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    type(measure_list_type), intent(in) :: measures  !! of the history
    integer(i8), intent(in) :: cut        !! bonds removed by cracks
    type(warnings_type), intent(in) :: warnings  !! found so far
    type(warnings_type), intent(in) :: notes     !! correct, but possibly unexpected facts
    integer, intent(in) :: threads        !! that the run may use
    character(:), allocatable :: text
    integer :: p

    text = ''
    if (scene%header%title /= '') text = trim(scene%header%title)//newline
    if (scene%header%defaults /= '') &
      & text = text//line('defaults', 'those of version '//trim(scene%header%defaults))
    text = text//line('points', to_text(system%body%order%n_global)//' in '// &
      & to_text(scene%header%dimension)//'D')
    associate (rule => system%family%rule)
      if (rule%ratio > 0.0_wp) then
        text = text//line('horizons', with_unit(rule%ratio*least_spacing(system), 'm')//' to '// &
          & with_unit(rule%delta, 'm')//', '//to_text(rule%ratio, 5)//' spacings of each point')
      else
        text = text//line('horizon', with_unit(rule%delta, 'm')//', '// &
          & to_text(rule%delta/greatest_spacing(system), 5)//' spacings of '// &
          & with_unit(greatest_spacing(system), 'm', 4))
      end if
    end associate
    text = text//line('bonds', to_text(system%family%n_bonds/2)//' pairs of points ('// &
      & to_text(system%family%n_bonds)//' if both directions count)')
    text = text//line('', 'at most '//to_text(system%family%most_bonds)//' at a point')
    if (size(scene%cracks) > 0) &
      & text = text//line('cracks', to_text(size(scene%cracks))//', which cut the bonds of '// &
      & to_text(cut)//' pairs')
    text = text//line('memory', with_unit(real(memory_of(system), wp), 'B', 3))
    text = text//forces(scene, system)//terms_of(system)
    text = text//line('threads', to_text(threads))
    if (plan%relaxes) then
      text = text//statics(scene, plan, system%model%breaking)
    else
      text = text//steps(scene, system, plan)
    end if
    text = text//measures%describe(system)
    do p = 1, notes%count()
      text = text//line('note', notes%line(p))
    end do
    do p = 1, warnings%count()
      text = text//line('warning', warnings%line(p))
    end do
  end function summary_before

  !> The largest spacing of all points [m].
  real(wp) function greatest_spacing(system) result(spacing)
    type(system_type), intent(in) :: system
    spacing = largest_over(system%body%order, system%body%spacing)
  end function greatest_spacing

  !> The smallest spacing of all points [m].
  real(wp) function least_spacing(system) result(spacing)
    type(system_type), intent(in) :: system
    spacing = -largest_over(system%body%order, -system%body%spacing)
  end function least_spacing

  !> How static equilibrium is found.
  pure function statics(scene, plan, breaking) result(text)
    type(scene_type), intent(in) :: scene
    type(plan_type), intent(in) :: plan
    logical, intent(in) :: breaking  !! bonds can break
    character(:), allocatable :: text

    text = line('relaxation', 'static equilibrium in '// &
      & counted(plan%relaxation%load_steps, 'load step'))
    if (plan%relaxation%events) then
      text = text//line('growth', 'by events; those within '//to_text(plan%relaxation%batch)// &
        & ' of the bond that is nearest to its limit break with it')
      text = text//line('', trim(merge('the load factor never decreases                        ', &
        & 'the load factor decreases where the response snaps back', &
        & plan%relaxation%load_controlled)))
    else if (breaking) then
      text = text//line('growth', 'all bonds beyond their limit break when a load step '// &
        & 'has converged')
    end if
    if (scene%relaxation%solver == 'dynamic_relaxation') then
      text = text//line('solver', 'dynamic relaxation, density matrix '// &
        & trim(scene%relaxation%density_matrix))
    else
      text = text//line('solver', 'conjugate gradient')
    end if
    text = text//line('tolerance', to_text(plan%relaxation%tolerance))
  end function statics

  !> The time step, where its limit is from, and how many there are.
  pure function steps(scene, system, plan) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(plan_type), intent(in) :: plan
    character(:), allocatable :: text

    text = line('time step', with_unit(plan%step, 's', 6)//', '// &
      & to_text(plan%step/plan%limit, 3)//' of the stable step')
    text = text//line('stable step', with_unit(plan%limit, 's', 6)//' for '//plan%integrator// &
      & trim(merge(', from the largest frequency of the body', ', from equation 7.25'// &
      & repeat(' ', 20), plan%spectral)))
    if (plan%spectral) then
      text = text//line('', 'measured in '//to_text(plan%evaluations)//' evaluations of the forces')
      if (system%model%breaking) text = text//line('', &
        & 'it holds for any state of broken bonds')
      text = text//line('equation 7.25', with_unit(plan%equation, 's', 6)// &
        & '; the stable step is '//to_text(plan%limit/plan%equation, 3)//' times as long')
    else if (scene%time%limit == 'spectral') then
      text = text//line('', 'the largest frequency does not allow a larger step')
    end if
    if (system%levels > 0) then
      text = text//line('substeps', to_text(2**system%levels)//' of '//with_unit(plan%step &
        & /2**system%levels, 's', 6)//' for the finest lattice')
    else if (.not. (system%model%weighted .or. system%model%generic)) then
      text = text//line('7.25 as printed', printed(plan))
      text = text//line('book''s estimate', with_unit(plan%book, 's', 6))
    end if
    text = text//line('steps', to_text(plan%steps))
    text = text//line('end time', with_unit(plan%steps*plan%step, 's', 6))
  end function steps

  !> How the forces are computed and why so.
  function forces(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    associate (model => system%model)
      text = line('families', system%family%describe()//system%workspace%describe())
      text = text//laws_of(model)
      if (model%generic) then
        text = text//line('forces', 'generic pass: each law gets all bonds of a point at a time')
        associate (history => system%workspace%generic%history)
          text = text//line('', with_unit(8.0_wp*size(history, kind=i8), 'B', 3)// &
            & ' of history of bonds, '//counted(size(history, 1), 'real')// &
            & ' for each direction of a bond')
        end associate
      else if (model%dilatation) then
        text = text//line('forces', 'state-based: two passes over the bonds, for the '// &
          & 'dilatations and for the forces')
        text = text//line('dilatation', trim(scene%horizon%dilatation))
      else
        text = text//line('forces', 'bond-based: one pass over the bonds, no dilatation')
      end if
      if (scene%horizon%surface_correction == 'energy' .and. .not. model%surface) then
        text = text//line('surfaces', 'not corrected: the bond law needs no correction')
      else if (model%consistent) then
        associate (b => model%weights%Gb, d => model%weights%Gd)
          text = text//line('surfaces', 'consistent weights of the bonds: Gb from '// &
            & to_text(minval(b), 3)//' to '//to_text(maxval(b), 3)//', Gd from '// &
            & to_text(minval(d), 3)//' to '//to_text(maxval(d), 3))
        end associate
      else
        text = text//line('surfaces', trim(merge('corrected by energy', 'not corrected      ', &
          & model%surface)))
      end if
      if (model%breaking) then
        text = text//line('fracture', 'bonds can break'// &
          & trim(merge(' in tension and in compression', repeat(' ', 30), model%compression)))// &
          & lattices(model)
      else if (any(scene%materials%critical_stretch > 0.0_wp) .or. &
        & any(scene%materials%critical_energy_release_rate > 0.0_wp)) then
        text = text//line('fracture', 'no bond can break: all points lie in no-fail zones')
      else
        text = text//line('fracture', 'no bond can break: no material has a critical stretch')
      end if
      text = text//line('thermal strain', trim(merge('yes', 'no ', model%thermal)))
      text = text//line('precision', precision_of(scene, system))
    end associate
  end function forces

  !> The critical stretches that follow from the lattice's toughness.
  pure function lattices(model) result(text)
    type(model_type), intent(in) :: model
    character(:), allocatable :: text
    integer :: i

    text = ''
    do i = 1, size(model%materials)
      associate (m => model%materials(i))
        if (.not. m%toughness > 0.0_wp) cycle
        text = text//line(trim(merge('crit. stretch', repeat(' ', 13), text == '')), &
          & to_text(m%critical_stretch, 4)//', 1/'//to_text(sqrt(m%toughness), 4)// &
          & ' of the formula''s: the toughness of the lattice (material '//to_text(i)//')')
      end associate
    end do
  end function lattices

  !> The bond laws, where they are not the chapter's with its influence function.
  function laws_of(model) result(text)
    type(model_type), intent(in) :: model
    character(:), allocatable :: text
    integer :: i

    text = ''
    if (.not. (model%weighted .or. model%generic)) return
    do i = 1, size(model%laws)
      associate (law => model%laws(i)%law)
        text = text//line(trim(merge('bond law', '        ', i == 1)), trim(law%name)// &
          & ', influence '//trim(law%influence)//trim(merge(', not corrected at surfaces', &
          & repeat(' ', 27), model%surface .and. .not. law%corrected)))
      end associate
    end do
  end function laws_of

  !> A line for each term of the force with a description.
  function terms_of(system) result(text)
    type(system_type), intent(in) :: system
    character(:), allocatable :: text, lines
    integer :: end_of_line

    text = ''
    lines = system%terms%describe()
    do while (len(lines) > 0)
      end_of_line = index(lines, newline)
      text = text//line('force term', lines(:end_of_line - 1))
      lines = lines(end_of_line + 1:)
    end do
  end function terms_of

  !> The precision of the bonds, and the reason if it is not the requested one.
  function precision_of(scene, system) result(text)
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    character(:), allocatable :: text

    text = 'double'
    select type (family => system%family)
    type is (lattice_family_type)
      if (family%mixed) text = 'mixed: bonds in single precision, state in double'
    type is (list_family_type)  ! in double precision alone
      continue
    type is (composite_family_type)  ! as lists
      continue
    class default
      call internal_fault('precision_of does not know a kind of family')
    end select
    if (text /= 'double' .or. scene%header%precision /= 'mixed') return
    text = text//': mixed precision is not available for '
    if (scene%header%dimension == 1) then
      text = text//'1D'
    else if (system%model%thermal) then
      text = text//'thermal strain'
    else
      text = text//'critical stretches this small'
    end if
  end function precision_of

  pure function printed(plan) result(text)
    type(plan_type), intent(in) :: plan
    character(:), allocatable :: text
    text = 'no value, because its sum is negative'
    if (plan%printed > 0.0_wp) text = with_unit(plan%printed, 's', 6)
  end function printed

  !> How large checkpoints are and how often they are written.
  pure function checkpoint_line(scene, bytes) result(text)
    type(scene_type), intent(in) :: scene
    integer(i8), intent(in) :: bytes
    character(:), allocatable :: text

    text = ''
    if (scene%output%checkpoint_every > 0) &
      & text = 'every '//to_text(scene%output%checkpoint_every)//' steps'
    if (scene%output%checkpoint_minutes > 0.0_wp) then
      if (text /= '') text = text//' and '
      text = text//'every '//duration_text(60*scene%output%checkpoint_minutes)
    end if
    if (text == '') text = 'only when the run is interrupted'
    text = '  checkpoints     '//with_unit(real(bytes, wp), 'B', 3)//', the last two kept, '//text
  end function checkpoint_line

  !> Memory of points and families [bytes].
  pure integer(i8) function memory_of(system) result(bytes)
    type(system_type), intent(in) :: system
    integer :: reals
    reals = system%body%dim*4 + 2          ! x, u, v, f; volume, spacing
    if (system%model%dilatation) reals = reals + 1
    if (system%model%breaking) reals = reals + 2  ! damage, s_c
    if (system%model%surface) reals = reals + 2*system%body%dim
    bytes = int(system%body%n_slots, i8)*(8*reals + 20 + system%body%dim) &
      & + system%family%bytes() + system%workspace%bytes() + system%model%weights%bytes()
  end function memory_of

end module pd_output_report_summary
