!> What the history has of contact: the energy that it stores, and what friction and impacts took.
module pd_output_measures_contact
  use pd_base_kinds, only: wp
  use pd_force_term, only: term_view_type
  use pd_motion_system, only: view_of
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: add_contacts

  !> All contacts of a scene together.
  type, extends(measure_type) :: contact_measure_type
  contains
    procedure :: columns => columns_of_contact
    procedure :: row => row_of_contact
  end type contact_measure_type

contains

  !> Add the columns if a scene has contact.
  subroutine add_contacts(scene, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(measure_list_type), intent(inout) :: measures   !! added to
    type(contact_measure_type) :: measure

    if (size(scene%contacts) > 0) call measures%add(measure)
  end subroutine add_contacts

  !> Three energies: the first is part of the strain energy, the others of the dissipated energy.
  function columns_of_contact(measure, dim) result(columns)
    class(contact_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)

    associate (unused_measure => measure, unused_dim => dim)
    end associate
    columns = [column_type('contact_energy', 'J', 'contact'), &
      & column_type('friction_work', 'J', 'contact'), &
      & column_type('contact_dissipation', 'J', 'contact')]
  end function columns_of_contact

  !> Their values.
  subroutine row_of_contact(measure, now, values)
    class(contact_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)
    type(term_view_type) :: view
    real(wp) :: stored

    associate (unused_measure => measure)
    end associate
    call view_of(now%system, now%system%time, view)
    call now%system%terms%accounts_of(view, 'friction', stored, values(2))
    call now%system%terms%accounts_of(view, 'contact', values(1), values(3))
  end subroutine row_of_contact

end module pd_output_measures_contact
