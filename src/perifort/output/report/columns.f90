!> The columns of the history: a table of what every run has, then the reaction forces of boundaries
!> with a name, then the fields of the probes.
module pd_output_report_columns
  use pd_base_kinds, only: wp
  use pd_base_reduce, only: largest_over
  use pd_force_generic_points, only: has_plasticity
  use pd_law_laws, only: law_table_type
  use pd_motion_observer, only: instant_type
  use pd_motion_system, only: energies_type, system_type
  use pd_output_fields_field, only: moment_type
  use pd_output_report_probes, only: probe_columns, probe_row, probe_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: laws_of, scene_type
  implicit none (type, external)
  private
  public :: history_table_type, history_table, history_columns, history_row, columns_of_scene, &
    & row_source_type

  character(*), parameter :: xyz(3) = ['x', 'y', 'z']

  !> What a row is taken from.
  type, extends(moment_type) :: row_source_type
    type(instant_type) :: instant
    type(energies_type) :: energies      !! at this instant
  end type row_source_type

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
  function history_columns(system, probes, relaxation) result(columns)
    type(system_type), intent(in) :: system
    type(probe_type), intent(in) :: probes(:)
    logical, intent(in) :: relaxation
    type(column_type), allocatable :: columns(:)
    type(history_table_type) :: table
    integer :: i

    table = history_table(relaxation, has_plasticity(system%model))
    columns = table%entries%column
    do i = 1, size(system%motions)
      columns = [columns, reactions_of(system%motions(i)%name, system%body%dim)]
    end do
    do i = 1, size(probes)
      columns = [columns, probe_columns(probes(i), system%body%dim)]
    end do
  end function history_columns

  !> The columns that a scene's history will have, without those of probes.
  function columns_of_scene(scene) result(columns)
    type(scene_type), intent(in) :: scene
    type(column_type), allocatable :: columns(:)
    type(history_table_type) :: table
    integer :: i

    table = history_table(scene%time%method == 'relaxation', names_plasticity(scene))
    columns = table%entries%column
    do i = 1, size(scene%boundaries)
      columns = [columns, reactions_of(trim(scene%boundaries(i)%name), scene%header%dimension)]
    end do
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

  !> Columns of the reaction force of a boundary, none without a name.
  pure function reactions_of(name, dim) result(columns)
    character(*), intent(in) :: name
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)
    integer :: c

    allocate (columns(merge(dim, 0, name /= '')))
    do c = 1, size(columns)
      columns(c) = column_type(name//'_reaction_'//xyz(c), 'N', 'boundary')
    end do
  end function reactions_of

  !> The values of `history_columns`.
  function history_row(table, now, probes) result(row)
    type(history_table_type), intent(in) :: table  !! of the run
    type(row_source_type), intent(in) :: now
    type(probe_type), intent(in) :: probes(:)
    real(wp), allocatable :: row(:)
    integer :: i

    row = [(table%entries(i)%value(now), i=1, size(table%entries))]
    associate (system => now%system)
      do i = 1, size(system%motions)
        if (system%motions(i)%name /= '') row = [row, system%motions(i)%reaction(:system%body%dim)]
      end do
    end associate
    do i = 1, size(probes)
      row = [row, probe_row(probes(i), now%moment_type)]
    end do
  end function history_row

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

end module pd_output_report_columns
