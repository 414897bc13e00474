!> The columns of the history: a table of what every run has, then those of the measures
!> (`pd_output_measures_measure`).
module pd_output_report_columns
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: largest_over
  use pd_force_generic_points, only: has_plasticity
  use pd_law_laws, only: law_table_type
  use pd_motion_system, only: greatest_ratio, system_type
  use pd_output_fields_table, only: field_table_type
  use pd_output_measures_measure, only: measure_list_type, row_source_type
  use pd_output_measures_table, only: measures_of
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: laws_of, scene_type
  implicit none (type, external)
  private
  public :: history_table_type, history_table, history_columns, history_row, columns_of_scene

  !> A column that every run has, or every relaxation.
  type :: entry_type
    type(column_type) :: column
    procedure(value_interface), pointer, nopass :: value => null()
  end type entry_type

  !> The columns that do not depend on names of the scene. A run makes its table once, since rows
  !> may be many.
  type :: history_table_type
    private
    type(entry_type), allocatable :: entries(:)
  end type history_table_type

  abstract interface
    !> The value of a column.
    real(wp) function value_interface(now)
      import :: row_source_type, wp
      implicit none (type, external)
      type(row_source_type), intent(in) :: now
    end function value_interface
  end interface

contains

  !> The table of columns. A column joins with a line here, and a function that gives its value.
  type(history_table_type) function history_table(relaxation, plastic) result(table)
    logical, intent(in) :: relaxation
    logical, intent(in) :: plastic      !! some bond law is plastic

    allocate (table%entries(0))
    call put(table, 'step', '1', step)
    call put(table, 'time', 's', time)
    call put(table, 'kinetic_energy', 'J', kinetic_energy)
    call put(table, 'strain_energy', 'J', strain_energy)
    call put(table, 'dissipated_energy', 'J', dissipated_energy)
    if (plastic) call put(table, 'plastic_energy', 'J', plastic_energy)
    call put(table, 'external_work', 'J', external_work)
    call put(table, 'broken_bonds', '1', broken_bonds)
    call put(table, 'maximum_damage', '1', maximum_damage)
    call put(table, 'step_size', 's', step_size)
    if (.not. relaxation) return
    call put(table, 'residual', '1', residual)
    call put(table, 'load_step', '1', load_step)
    call put(table, 'events', '1', events)
    call put(table, 'stretch_ratio', '1', stretch_ratio)
  end function history_table

  !> Add a column at the end.
  subroutine put(table, name, unit, value)
    type(history_table_type), intent(inout) :: table
    character(*), intent(in) :: name, unit
    procedure(value_interface) :: value
    type(entry_type) :: entry

    entry%column = column_type(name, unit, 'run')
    entry%value => value
    table%entries = [table%entries, entry]
  end subroutine put

  !> The columns of the history, in the order of `history_row`.
  function history_columns(system, measures, relaxation) result(columns)
    type(system_type), intent(in) :: system
    type(measure_list_type), intent(in) :: measures
    logical, intent(in) :: relaxation
    type(column_type), allocatable :: columns(:)
    type(history_table_type) :: table

    table = history_table(relaxation, has_plasticity(system%model))
    columns = [table%entries%column, measures%columns(system%body%dim)]
  end function history_columns

  !> The columns that a scene's history will have, without those of probes.
  function columns_of_scene(scene, fields) result(columns)
    type(scene_type), intent(in) :: scene         !! a checked scene, whose fields are known
    type(field_table_type), intent(in) :: fields  !! that it may name
    type(column_type), allocatable :: columns(:)
    type(history_table_type) :: table
    type(measure_list_type) :: measures

    table = history_table(scene%time%method == 'relaxation', names_plasticity(scene))
    call measures_of(scene, fields, measures)
    columns = measures%columns(scene%header%dimension)
    columns = [table%entries%column, pack(columns, columns%origin /= 'probe')]
  end function columns_of_scene

  !> Whether a scene names a plastic bond law.
  logical function names_plasticity(scene)
    type(scene_type), intent(in) :: scene
    type(law_table_type) :: laws
    integer :: i, n

    laws = laws_of(scene)
    names_plasticity = .false.
    do i = 1, size(scene%materials)
      n = laws%number_of(scene%materials(i)%model)
      if (n > 0) names_plasticity = names_plasticity .or. laws%items(n)%law%plastic
    end do
  end function names_plasticity

  !> The values of `history_columns`, once for each row.
  subroutine history_row(table, now, measures, row)
    type(history_table_type), intent(in) :: table          !! of the run
    type(row_source_type), intent(in) :: now               !! the instant
    type(measure_list_type), intent(inout) :: measures     !! of the run, which go from row to row
    real(wp), allocatable, intent(out) :: row(:)           !! (columns)
    real(wp), allocatable :: measured(:)
    integer :: i

    call measures%row(now, measured)
    row = [(table%entries(i)%value(now), i=1, size(table%entries)), measured]
  end subroutine history_row

  pure real(wp) function step(now)
    type(row_source_type), intent(in) :: now
    step = now%instant%step
  end function step

  pure real(wp) function time(now)
    type(row_source_type), intent(in) :: now
    time = now%instant%time
  end function time

  pure real(wp) function kinetic_energy(now)
    type(row_source_type), intent(in) :: now
    kinetic_energy = now%energies%kinetic
  end function kinetic_energy

  pure real(wp) function strain_energy(now)
    type(row_source_type), intent(in) :: now
    strain_energy = now%energies%strain
  end function strain_energy

  pure real(wp) function dissipated_energy(now)
    type(row_source_type), intent(in) :: now
    dissipated_energy = now%system%dissipated
  end function dissipated_energy

  pure real(wp) function plastic_energy(now)
    type(row_source_type), intent(in) :: now
    plastic_energy = now%system%plastic_energy
  end function plastic_energy

  pure real(wp) function external_work(now)
    type(row_source_type), intent(in) :: now
    external_work = now%system%external_work
  end function external_work

  pure real(wp) function broken_bonds(now)
    type(row_source_type), intent(in) :: now
    broken_bonds = real(now%system%broken, wp)
  end function broken_bonds

  !> 0 where nothing can be damaged.
  real(wp) function maximum_damage(now)
    type(row_source_type), intent(in) :: now
    maximum_damage = 0.0_wp
    if (size(now%system%state%damage) > 0) &
      & maximum_damage = largest_over(now%system%body%order, now%system%state%damage)
  end function maximum_damage

  pure real(wp) function step_size(now)
    type(row_source_type), intent(in) :: now
    step_size = now%instant%dt
  end function step_size

  pure real(wp) function residual(now)
    type(row_source_type), intent(in) :: now
    residual = now%instant%residual
  end function residual

  pure real(wp) function load_step(now)
    type(row_source_type), intent(in) :: now
    load_step = now%instant%load_step
  end function load_step

  pure real(wp) function events(now)
    type(row_source_type), intent(in) :: now
    events = now%instant%events
  end function events

  !> 1 where the next bond breaks.
  real(wp) function stretch_ratio(now)
    type(row_source_type), intent(in) :: now
    stretch_ratio = greatest_ratio(now%system)
  end function stretch_ratio

end module pd_output_report_columns
